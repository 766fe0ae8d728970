// What do many units have in common where the data of each say little? Random effects within the likelihood.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "solvers/scoring.h"

namespace identikal {

/// log p(data | theta, b_1, ..., b_U) of U units, each with q effects of its own:
///
///   b_i ~ N(mu, Omega),  i = 1 .. U;  of an effect that is logarithmic, log b_i.
struct MixedEffectsProblem {
  /// By n coordinates: those that all units share, and the effects of each. Units share no
  /// information but by the former: the effects of two have none in common.
  LikelihoodProblem data;
  std::vector<Eigen::Index> shared;  ///< p of the n
  /// Of each shared one the unit whose data alone it is of, -1: of several. Empty: all of several.
  std::vector<Eigen::Index> unit_of_shared;
  Eigen::Matrix<Eigen::Index, Eigen::Dynamic, Eigen::Dynamic> effects;  ///< q x U, the others
  std::vector<bool> logarithmic;                                        ///< q
  bool correlated = false;                                              ///< else Omega is diagonal
};

/// Where a search begins. Means and spreads are those of logarithms where effects are.
struct MixedEffectsStart {
  Eigen::VectorXd shared;  ///< p
  Eigen::VectorXd mean;    ///< q
  Eigen::VectorXd spread;  ///< q, standard deviations, positive
};

/// A number with its standard error and its 95 % interval.
struct MarginalEstimate {
  double value = 0.0, se = 0.0;
  double low = 0.0, high = 0.0;
};

struct MixedEffects {
  SolverSummary summary;  ///< objective: the marginal log-likelihood
  std::vector<MarginalEstimate> shared, mean, spread;
  Eigen::MatrixXd Omega;  ///< q x q
  bool observed = false;  ///< `covariance` is from observed information; else from the expected one
  Eigen::MatrixXd covariance;  ///< of shared, mean, spread in this order; empty: no errors
  std::vector<MarginalEstimate> correlation;  ///< below Omega's diagonal, column by column
  Eigen::VectorXd x;                          ///< n: shared, and each unit's most probable effects
  Eigen::MatrixXd effects, effects_se;        ///< q x U, in the scale that they are normal in
  /// Per unit: chance that one of the population lies as far from the mean.
  Eigen::VectorXd p_value;
  std::vector<bool> spread_at_zero;  ///< q: not told from zero; `high` is its upper limit
};

/// Maximises the likelihood of the units' data over theta, mu and Omega, the effects integrated out
/// by Laplace's method: with L L' = Omega and b_i = mu + L z_i,
///
///   log p(data) = sum_i max_z (log p(data_i | theta, mu + L z) - z'z / 2) - 1/2 log det H_i,
///   H_i = L' J_i L + 1,  J_i the Fisher information on b_i there;
///
/// exact where the data are linear in the effects with normal errors. The gradient holds how the most
/// probable effects and H_i move. Standard errors from differences of it (of more than 60 unknowns
/// from the information of a linear model with the same J_i), intervals of spreads by
/// their logarithms, of means by Student's t with U - 1 degrees of freedom.
/// Sources: Tierney & Kadane (1986), JASA 81; Pinheiro & Bates (1995), "Approximations to the
/// log-likelihood function in the nonlinear mixed-effects model", eq. 6; Bates et al. (2015), J. Stat. Soft. 67.
///
/// Example:
///
///     const Eigen::Matrix<Eigen::Index, 1, 3> places{1, 2, 3};
///     const MixedEffectsProblem units{LikelihoodProblem(), {0}, {}, places, {false}};
///     const Eigen::VectorXd one = Eigen::VectorXd::Ones(1);  // data: by a variance and three b_i
///     const MixedEffects all = maximise_marginal(units, {one, one, one});
///     std::printf("%g, between units %g\n", all.mean[0].value, all.spread[0].value);
///
/// @param with_errors  false: of one search among several
/// @throws std::invalid_argument for sizes that disagree, fewer than two units, or a spread that is
///   not positive
MixedEffects maximise_marginal(const MixedEffectsProblem& problem, const MixedEffectsStart& start,
                               const SolverOptions& options = {}, bool with_errors = true);

}  // namespace identikal
