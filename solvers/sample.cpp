#include "solvers/sample.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <stdexcept>
#include <vector>

#include <Eigen/Cholesky>

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kNowhere = -std::numeric_limits<double>::infinity();

// Weights of a rise of the temperature by `step`, largest 1; -infinity weighs nothing.
VectorXd weights(const VectorXd& log_likelihood, double step) {
  const double largest = log_likelihood.maxCoeff();
  return log_likelihood.unaryExpr(
      [=](double L) { return std::isfinite(L) ? std::exp(step * (L - largest)) : 0.0; });
}

double effective_share(const VectorXd& w) {
  return w.sum() * w.sum() / (w.squaredNorm() * static_cast<double>(w.size()));
}

// The largest rise that leaves half of the draws effective, or what is left to 1.
double next_step(const VectorXd& log_likelihood, double left) {
  constexpr double kShare = 0.5;
  // Draws of the prior without a likelihood cannot be effective at any temperature.
  const double most = static_cast<double>((log_likelihood.array() > kNowhere).count()) /
                      static_cast<double>(log_likelihood.size());
  const auto enough = [&](double step) {
    return effective_share(weights(log_likelihood, step)) >= kShare * most;
  };
  if (enough(left)) return left;
  double low = 0.0, high = left;
  for (int i = 0; i < 60; ++i) (enough(0.5 * (low + high)) ? low : high) = 0.5 * (low + high);
  return std::max(low, 1e-12);
}

// Positions of n draws by systematic resampling.
std::vector<Index> resampled(const VectorXd& w, Random& random) {
  const Index n = w.size();
  const double pitch = w.sum() / static_cast<double>(n);
  double at = random.uniform() * pitch, sum = w[0];
  std::vector<Index> out;
  for (Index i = 0, from = 0; i < n; ++i, at += pitch) {
    while (sum < at && from + 1 < n) sum += w[++from];
    out.push_back(from);
  }
  return out;
}

// A factor of the draws' covariance; directions in which all agree get a little.
MatrixXd spread(const MatrixXd& draws) {
  const VectorXd mean = draws.rowwise().mean();
  const MatrixXd centred = draws.colwise() - mean;
  MatrixXd covariance = centred * centred.transpose() / static_cast<double>(draws.cols());
  const VectorXd floor = 1e-12 * (covariance.diagonal() + 1e-12 * mean.cwiseAbs2());
  covariance.diagonal() += floor.cwiseMax(1e-300);
  return covariance.llt().matrixL();
}

}  // namespace

PosteriorSample sample(const PosteriorProblem& problem, const SampleOptions& options) {
  constexpr int kMostMoves = 50;
  // Accepted by every draw, on average: on the way, and at the end, where copies of one draw have
  // to part.
  constexpr double kOnTheWay = 3.0, kAtTheEnd = 10.0;
  if (options.draws < 10) throw std::invalid_argument("sample: fewer than 10 draws");
  const auto begin = std::chrono::steady_clock::now();
  const Index n = options.draws;
  Random random(options.seed);
  PosteriorSample out;
  SolverSummary& summary = out.summary;
  out.log_prior.resize(n);
  out.log_likelihood.resize(n);
  for (Index i = 0; i < n; ++i) {
    const VectorXd x = problem.draw_prior(random);
    if (i == 0) out.draws.resize(x.size(), n);
    out.draws.col(i) = x;
    out.log_prior[i] = problem.log_prior(x);
    out.log_likelihood[i] = problem.log_likelihood(x);
    ++summary.evaluations;
  }
  const auto finish = [&](Termination termination, const char* message) {
    summary.termination = termination;
    summary.message = message;
    std::vector<Index> order(static_cast<std::size_t>(n));
    for (Index i = 0; i < n; ++i) order[static_cast<std::size_t>(i)] = i;
    const auto less = [&](Index a, Index b) {
      return std::lexicographical_compare(out.draws.col(a).begin(), out.draws.col(a).end(),
                                          out.draws.col(b).begin(), out.draws.col(b).end());
    };
    std::sort(order.begin(), order.end(), less);
    out.distinct = n > 0 ? 1 : 0;
    for (std::size_t i = 1; i < order.size(); ++i) out.distinct += less(order[i - 1], order[i]);
    return out;
  };
  if (!(out.log_likelihood.maxCoeff() > kNowhere)) {
    return finish(Termination::no_progress,
                  "the likelihood is undefined at every draw of the prior");
  }
  const auto d = static_cast<double>(out.draws.rows());
  double temperature = 0.0, scale = 2.38 / std::sqrt(d);
  while (temperature < 1.0) {
    const double step = next_step(out.log_likelihood, 1.0 - temperature);
    const VectorXd w = weights(out.log_likelihood, step);
    out.log_evidence += step * out.log_likelihood.maxCoeff() + std::log(w.mean());
    temperature = step >= 1.0 - temperature ? 1.0 : temperature + step;
    const std::vector<Index> kept = resampled(w, random);
    out.draws = MatrixXd(out.draws(Eigen::all, kept));
    out.log_prior = VectorXd(out.log_prior(kept));
    out.log_likelihood = VectorXd(out.log_likelihood(kept));
    const MatrixXd L = spread(out.draws);
    double accepted = 0.0;
    const double wanted = temperature < 1.0 ? kOnTheWay : kAtTheEnd;
    for (int move = 0; move < kMostMoves && accepted < wanted; ++move) {
      Index count = 0;
      for (Index i = 0; i < n; ++i) {
        const VectorXd x = out.draws.col(i) + scale * (L * random.normal(out.draws.rows()));
        const double threshold = std::log(random.uniform());
        const double prior = problem.log_prior(x);
        if (!(prior > kNowhere)) continue;
        const double likelihood = problem.log_likelihood(x);
        ++summary.evaluations;
        const double rise =
            prior - out.log_prior[i] + temperature * (likelihood - out.log_likelihood[i]);
        if (!(rise > threshold)) continue;
        out.draws.col(i) = x;
        out.log_prior[i] = prior;
        out.log_likelihood[i] = likelihood;
        ++count;
      }
      const double rate = static_cast<double>(count) / static_cast<double>(n);
      accepted += rate;
      scale *= std::clamp(std::exp(rate - 0.3), 0.6, 1.6);
    }
    ++out.stages;
    ++summary.iterations;
    const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - begin;
    if (options.progress && !options.progress(temperature)) {
      return finish(Termination::time_limit, "stopped by the caller");
    }
    if (temperature < 1.0 && spent.count() > options.max_seconds) {
      return finish(Termination::time_limit, "the time limit was reached");
    }
  }
  return finish(Termination::converged, "the posterior is reached");
}

}  // namespace identikal
