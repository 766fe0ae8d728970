// How probable are noise covariances, given a recording and what was known before?
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "identify/estimate/results.h"
#include "identify/model/model.h"
#include "lib/data/dataset.h"
#include "solvers/problem.h"

namespace identikal {

struct NoiseBayesOptions {
  Eigen::Index draws = 2000;  ///< of sequential Monte Carlo
  std::uint64_t seed = 1;
  bool grid = true;  ///< where one or two numbers are unknown, on a grid that checks itself
  /// Of sequential Monte Carlo: not converged when it takes longer.
  double max_seconds = 300.0;
  /// Called while draws are made, with the share that is done; return false to stop, not converged.
  std::function<bool(double share)> progress;
};

/// A posterior as points with weights that sum to one.
struct PosteriorPoints {
  Eigen::MatrixXd entries;      ///< k x n, free entries (lib/model/parameter.h)
  Eigen::MatrixXd coordinates;  ///< k x n, of identify/model/parameter_prior.h
  Eigen::VectorXd weight;       ///< n
  Eigen::VectorXd log_density;  ///< n, prior times likelihood by the coordinates, up to a constant
  double log_evidence = 0.0;
  double effective = 0.0;
  bool on_grid = false;
  int left_behind = 0;  ///< of a recursion: times that the draws could not follow a sample
  std::string method = "sequential Monte Carlo";  ///< or "grid", "importance sampling"
  SolverSummary summary;
};

/// The posterior of all free parameters under parameter_prior() (identify/model/parameter_prior.h):
/// of one or two numbers on a grid, of more by sequential Monte Carlo. A nonlinear model, whose
/// likelihood is dear, by importance sampling where its posterior allows it.
/// @throws InputError as parameter_prior()
PosteriorPoints posterior(const Model& model, const std::vector<Dataset>& recordings,
                          const NoiseBayesOptions& options = {});

/// What every Bayesian estimator says of its posterior: of each parameter the mean, the standard
/// deviation, the central 95 % credible interval and the most probable point; correlation; and
/// which parameters have a posterior as wide as their prior (not identifiable).
/// @return where that comes from
Posterior report_posterior(Estimate& estimate, const Model& model, const PosteriorPoints& points,
                           const std::string& method);

/// Posteriors piled up against the edge of their priors, as report_posterior() judged them.
Findings check_priors(const Estimate& estimate, const Posterior& posterior);

/// The posterior of the recordings' noise and the filter at its mean. Source: Matisko (2013),
/// sections 4.4 and 4.5, with proper moves instead of (4.31): see solvers/sample.h.
///
/// Example:
///
///     NoiseBayesOptions options;
///     options.draws = 4000;
///     const auto estimate = tune_bayes(model, recordings, options);
///
/// @throws InputError as check_recordings() and posterior()
NoiseEstimate tune_bayes(const Model& model, const std::vector<Dataset>& recordings,
                         const NoiseBayesOptions& options = {});

}  // namespace identikal
