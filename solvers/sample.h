// What does a posterior look like? Draws from it by sequential Monte Carlo.
#pragma once

#include <cstdint>
#include <functional>

#include <Eigen/Core>

#include "lib/base/random.h"
#include "solvers/problem.h"

namespace identikal {

struct PosteriorProblem {
  std::function<Eigen::VectorXd(Random&)> draw_prior;
  /// Up to a constant; -infinity outside the prior's support.
  std::function<double(const Eigen::VectorXd&)> log_prior;
  /// -infinity where it is undefined.
  std::function<double(const Eigen::VectorXd&)> log_likelihood;
};

struct SampleOptions {
  Eigen::Index draws = 2000;
  std::uint64_t seed = 1;
  double max_seconds = std::numeric_limits<double>::infinity();
  /// Called after every stage with the temperature reached, 0 to 1; return false to stop.
  std::function<bool(double)> progress;
  /// The same after every move of all draws: a stage takes up to 50.
  std::function<bool(double)> moved = {};
};

struct PosteriorSample {
  Eigen::MatrixXd draws;           ///< d x n, equally likely
  Eigen::VectorXd log_likelihood;  ///< n
  Eigen::VectorXd log_prior;       ///< n
  double log_evidence = 0.0;       ///< log of the likelihood's mean under the prior
  Eigen::Index distinct = 0;       ///< draws that differ from all others
  int stages = 0;                  ///< temperatures between prior and posterior
  SolverSummary summary;
};

/// Draws from the prior, then raises the likelihood to powers t from 0 to 1, each power as large as
/// leaves half of the draws effective, (sum w)^2 = n / 2 sum w^2. Every stage weights, resamples
/// (systematic) and moves every draw by random-walk Metropolis steps of the draws' own covariance
/// until most have moved several times. The moves leave the posterior as it is; the published
/// alternative, to perturb resampled draws by noise of a fixed size (Matisko 2013, (4.31)), widens
/// it by that noise at every iteration. Deterministic for a seed. Converged when t = 1 is reached;
/// no_progress when no draw of the prior has a defined likelihood. Sources: Del Moral, Doucet &
/// Jasra (2006), J. R. Statist. Soc. B 68; Jasra et al. (2011) for the choice of powers.
///
/// Example:
///
///     PosteriorProblem problem;  // a standard normal number, seen as 1.5 with an error of sd 0.5
///     problem.draw_prior = [](Random& random) { return random.normal(1); };
///     problem.log_prior = [](const auto& x) { return -0.5 * x.squaredNorm(); };
///     problem.log_likelihood = [](const auto& x) { return -2.0 * std::pow(x[0] - 1.5, 2); };
///     const double mean = sample(problem).draws.mean();  // 1.2
///
/// @throws std::invalid_argument when fewer than 10 draws are requested
PosteriorSample sample(const PosteriorProblem& problem, const SampleOptions& options = {});

}  // namespace identikal
