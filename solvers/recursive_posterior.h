// Which noise of a Kalman filter is probable, as samples arrive?
#pragma once

#include <functional>

#include <Eigen/Core>

#include "lib/base/random.h"
#include "lib/filter/filter_bank.h"
#include "lib/model/state_space.h"

namespace identikal {

/// Where a filter stands before its first sample, and the log-density of what it has seen already.
struct FilterStart {
  Eigen::VectorXd x;
  Eigen::MatrixXd P;
  double log_density = 0.0;
};

/// One model whose noise has unknown coordinates.
struct NoiseProblem {
  StateSpace shared;  ///< A, B, C, D
  std::function<Eigen::VectorXd(Random&)> draw_prior;
  /// Up to a constant; -infinity outside the prior's support.
  std::function<double(const Eigen::VectorXd&)> log_prior;
  /// G, Q, S, R at these coordinates.
  std::function<StateSpace(const Eigen::VectorXd&)> noise;
  std::function<FilterStart(const StateSpace& noise)> start;
};

/// Draws with weights, a Kalman filter for each, and the samples seen.
struct RecursivePosterior {
  Eigen::MatrixXd draws;           ///< d x m
  Eigen::VectorXd log_weight;      ///< m: log-likelihood since the draws were last equally likely
  Eigen::VectorXd log_likelihood;  ///< m: of all samples
  Eigen::VectorXd log_prior;       ///< m
  FilterBank bank;
  /// Seen, one sample per column; columns beyond `samples` are room. One draw keeps none.
  Eigen::MatrixXd y, u;
  Eigen::Index samples = 0;
  Eigen::Index equal_at = 0;  ///< samples seen when the draws were last equally likely
  int renewals = 0;
  /// Samples that renewals have run each draw over, and what they may run it over: 300 for every
  /// sample. Ordinary recordings take 20 to 50.
  Eigen::Index work = 0;
  Eigen::Index samples_before = 0;  ///< seen by a posterior whose work is counted on here
  int left_behind = 0;              ///< renewals that this has cut short: draws that nothing moved
  Random random{1};
  Eigen::VectorXd before, density, share;  ///< m: room for one sample
};

/// @param draws  m; one draw never moves: a filter whose noise is taken as known
/// @throws std::invalid_argument for no draw
///
/// Example:
///
///     RecursivePosterior posterior = start_posterior(unknown_noise, 400, 1);
///     for (Eigen::Index t = 0; t < y.cols(); ++t) {
///       observe(posterior, unknown_noise, y.col(t), u.col(t));
///     }
///     const Eigen::VectorXd mean = posterior.draws * weights(posterior);
RecursivePosterior start_posterior(const NoiseProblem& problem, Eigen::Index draws,
                                   std::uint64_t seed);

/// Weights that sum to one.
Eigen::VectorXd weights(const RecursivePosterior& posterior);
/// The same into `out`, whose memory is used again.
void weights(const RecursivePosterior& posterior, Eigen::VectorXd& out);

/// Takes a sample: every draw's weight is multiplied by p(y | samples before, draw) of its own
/// filter. When fewer than half of the draws count, (sum w)^2 < m / 2 sum w^2, the weak ones are
/// replaced by copies of the strong and all are moved by random-walk Metropolis steps, for which
/// the bank runs over the samples again. So the draws are from the posterior of all samples at any
/// time, and the work of a long recording is a few times that of its filters, as renewals become
/// rarer as fast as they become longer. A sample that all draws are as far from as a sensor's
/// mistake of 1e12 would take hundreds of stages: there the draws become copies of the nearest.
/// Nothing is allocated but for renewals and, whenever their number has doubled, for the samples.
///
/// Matisko (2013), section 4.6, lets a replaced member inherit weight and state of its nearest
/// neighbour, "as the likelihood of all data cannot be computed for it", and perturbs it by a noise
/// of a size that is set by hand: each replacement then widens the posterior, and by more the
/// larger the units are. Sources: Chopin (2002), Biometrika 89; Del Moral, Doucet & Jasra (2006).
/// @param y  ny, NaN = missing  @param u  nu
/// @return log p(y | samples before); -infinity where no draw has a density, and then the sample
/// does not count
double observe(RecursivePosterior& posterior, const NoiseProblem& problem,
               const Eigen::Ref<const Eigen::VectorXd>& y,
               const Eigen::Ref<const Eigen::VectorXd>& u);

}  // namespace identikal
