// What do many units have in common, and how much do they differ, when each is known with an error of its own?
#pragma once

#include <array>
#include <vector>

#include <Eigen/Core>

namespace identikal {

struct RandomEffectsOptions {
  double level = 0.95;  ///< of intervals, 0 < level < 1
  /// Of the units that are said not to belong, the share that belongs all the same, on average.
  double false_discoveries = 0.05;
};

struct RandomEffects {
  // The mean is X beta; without covariates beta is the mean itself.
  Eigen::VectorXd beta;                         ///< p
  Eigen::VectorXd se;                           ///< p, standard errors
  std::vector<std::array<double, 2>> interval;  ///< p, of beta, by Student's t
  Eigen::VectorXd p_value;                      ///< p, two-sided, of beta = 0
  double freedom = 0.0;                         ///< n - p
  // Between the units, beyond their own errors:
  double sd = 0.0;
  std::array<double, 2> sd_interval{0.0, 0.0};
  double log_likelihood = 0.0;  ///< restricted, at its maximum
  // Are they all the same? Cochran's Q is chi-squared with n - p degrees of freedom if they are.
  double q = 0.0, q_p_value = 1.0;
  // Unit by unit:
  Eigen::VectorXd shrunken, shrunken_se;  ///< best prediction of each, and its standard error
  Eigen::VectorXd distance;  ///< from what the others make expect, in standard deviations of it
  std::vector<bool> belongs;
};

/// The normal model with random effects of known errors,
///
///   y_i = x_i' beta + b_i + e_i,  b_i ~ N(0, sd^2),  e_i ~ N(0, v_i),
///
/// with sd by restricted maximum likelihood (Fisher scoring), the errors of beta by Hartung and Knapp,
/// which allow for the error of sd, and the interval of sd by the Q profile, which is exact for normal
/// b and e: the sd for which sum (y - X beta)^2 / (v + sd^2) is a quantile of chi-squared. A unit is
/// set against what all others make expect of it (beta and sd without it; from 500 units on with it,
/// when one changes little), and does not belong where Benjamini and Hochberg's procedure says so.
///
/// Example:
///
///     const Eigen::VectorXd y = Eigen::VectorXd::LinSpaced(5, 1.0, 2.0);
///     const Eigen::VectorXd v = Eigen::VectorXd::Constant(5, 0.01);
///     const RandomEffects all = random_effects(y, v, Eigen::MatrixXd::Ones(5, 1));
///     std::printf("%g, sd %g\n", all.beta[0], all.sd);
///
/// @param y  n estimates, finite   @param v  n, their variances, positive   @param X  n x p, rank p
/// @throws std::invalid_argument for other shapes, n < p + 2, or columns that depend on each other
/// Sources: Raudenbush (2009), "Analyzing effect sizes: random-effects models"; Knapp and Hartung
/// (2003), Statistics in Medicine 22; Viechtbauer (2007), ibid. 26; Benjamini and Hochberg (1995).
RandomEffects random_effects(const Eigen::Ref<const Eigen::VectorXd>& y,
                             const Eigen::Ref<const Eigen::VectorXd>& v,
                             const Eigen::Ref<const Eigen::MatrixXd>& X,
                             const RandomEffectsOptions& options = {});

/// Several estimates of each of some units as one of each: their mean, weighted by v + w, with its
/// variance; w is what the estimates of a unit differ by beyond their errors, of all units together.
struct CombinedUnits {
  Eigen::VectorXd y, v;  ///< by unit
  double within_sd = 0.0;
};

/// @param unit  of each estimate, 0 .. units - 1, each of which has one at least
/// Source: DerSimonian and Laird (1986), the moment estimator, pooled.
CombinedUnits combine_units(const Eigen::Ref<const Eigen::VectorXd>& y,
                            const Eigen::Ref<const Eigen::VectorXd>& v,
                            const std::vector<int>& unit, int units);

}  // namespace identikal
