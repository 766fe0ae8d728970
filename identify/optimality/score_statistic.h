// Would other noise covariances explain the recordings better, which, and by how much? Answered at
// the present ones, nothing is fitted.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "identify/model/model.h"
#include "lib/data/dataset.h"
#include "lib/filter/kalman.h"
#include "lib/filter/recording_digest.h"
#include "lib/statistics/whiteness.h"

namespace identikal {

/// The model with the entries of its noise as the only free parameters: those that the file leaves
/// free in Q, R and S, or, where it leaves none, all entries of Q and of R.
Model with_free_noise(const Model& model);

struct ScoreStatistic {
  FilterStatus status = FilterStatus::ok;  ///< else the rest is empty
  std::vector<std::string> names;          ///< of the k entries tested
  Eigen::VectorXd value;                   ///< as given, SI
  Eigen::VectorXd direction;     ///< g_i / sqrt(J_ii): standard normal at the true noise; positive:
                                 ///< the entry alone should be larger
  Eigen::VectorXd step;          ///< J^+ g, SI: one step of Fisher scoring
  Eigen::VectorXd step_se;       ///< sqrt(diag J^+); NaN where the data do not determine the entry
  ChiSquareStatistic statistic;  ///< g' J^+ g, rank of J degrees of freedom
};

/// Rao's (1948) score test of the present noise: gradient g of the log-likelihood by the entries
/// against its Fisher information J. To first order no test is more powerful against other noise,
/// as the innovations' whiteness and size are looked at where noise shows in them and nowhere else.
/// It has no power against faults of the model that no noise explains.
///
/// Example:
///
///     const Model freed = with_free_noise(model);
///     const ScoreStatistic score = score_statistic(freed, recordings);
///     std::printf("chi-square %g of %g\n", score.statistic.value, score.statistic.dof);
///
/// @param model  as with_free_noise() returns it
/// @throws std::invalid_argument when nothing is free
ScoreStatistic score_statistic(const Model& model, const std::vector<Dataset>& recordings);
/// The same of recordings that are no longer there.
ScoreStatistic score_statistic(const Model& model, const std::vector<RecordingDigest>& digests);

/// Where a few steps of scoring lead from the present noise, and what staying costs.
struct Retuned {
  ParameterSet parameters;
  double gain = 0.0;  ///< of the log-likelihood
  /// Predicted tr P(present gain) / tr P(optimal gain) - 1, both under the noise found; NaN when a
  /// steady state is missing, as of a nonlinear model.
  double loss = 0.0;
};

/// At most ten Fisher scoring steps (solvers/scoring.h); most of the way to the maximum from
/// anywhere, not an estimate: no convergence is asked for. For a filter that is
/// optimal the loss is what chance makes of it.
/// @param model  as with_free_noise() returns it
Retuned retuned(const Model& model, const std::vector<Dataset>& recordings);
Retuned retuned(const Model& model, const std::vector<RecordingDigest>& digests);

}  // namespace identikal
