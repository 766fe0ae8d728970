#include "solvers/sample.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <stdexcept>
#include <vector>

#include "lib/base/constants.h"
#include "solvers/internal/resampling.h"

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

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
  if (!(out.log_likelihood.maxCoeff() > -kInfinity)) {
    return finish(Termination::no_progress,
                  "the likelihood is undefined at every draw of the prior");
  }
  const auto d = static_cast<double>(out.draws.rows());
  double temperature = 0.0, scale = 2.38 / std::sqrt(d);
  while (temperature < 1.0) {
    const double step = next_step(out.log_likelihood, 1.0 - temperature);
    const VectorXd w = tempered_weights(out.log_likelihood, step);
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
        if (!(prior > -kInfinity)) continue;
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
      return finish(Termination::stopped, "stopped by the caller");
    }
    if (temperature < 1.0 && spent.count() > options.max_seconds) {
      return finish(Termination::time_limit, "the time limit was reached");
    }
  }
  return finish(Termination::converged, "the posterior is reached");
}

}  // namespace identikal
