// How probable are noise covariances, given a recording and what was known before?
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "identify/estimate.h"
#include "identify/model_file.h"
#include "lib/dataset.h"
#include "solvers/problem.h"

namespace identikal {

struct NoiseBayesOptions {
  Eigen::Index draws = 2000;  ///< of sequential Monte Carlo
  std::uint64_t seed = 1;
  bool grid = true;  ///< where one or two numbers are unknown, on a grid: exact, without chance
  std::function<void(double temperature)> progress;
};

/// A posterior as points with weights that sum to one.
struct PosteriorPoints {
  Eigen::MatrixXd entries;      ///< k x n, free entries (lib/parameter.h)
  Eigen::MatrixXd coordinates;  ///< k x n, in which the prior factorises (see tune_bayes)
  Eigen::VectorXd weight;       ///< n
  Eigen::VectorXd log_density;  ///< n, prior times likelihood by the coordinates, up to a constant
  double log_evidence = 0.0;
  double effective = 0.0;
  SolverSummary summary;
};

/// The posterior of all free parameters. Coordinates are numbers, their logarithms where the prior
/// is one of the logarithm, and for a full covariance matrix the logarithms of its variances and
/// its partial correlations, whose prior makes every correlation matrix equally probable
/// (Lewandowski, Kurowicka & Joe 2009).
/// @throws InputError when a number that is no variance has neither prior nor two finite bounds
PosteriorPoints posterior(const ModelFile& model, const std::vector<Dataset>& recordings,
                          const NoiseBayesOptions& options = {});

/// Mean, standard deviation, central 95 % credible interval, most probable point. The prior of each
/// number is Parameter::prior; without one, log-uniform over four decades either way of the start
/// for a variance, uniform between its bounds for another number. A parameter whose posterior is as
/// wide as its prior is called flat. Source: Matisko (2013), sections 4.4 and 4.5, with proper
/// moves instead of (4.31): see solvers/sample.h.
/// @throws InputError as check_recordings() and posterior()
Estimate tune_bayes(const ModelFile& model, const std::vector<Dataset>& recordings,
                    const NoiseBayesOptions& options = {});

}  // namespace identikal
