#include "solvers/sample.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <vector>

#include "lib/base/constants.h"
#include "solvers/internal/resampling.h"

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

PosteriorSample draw_prior(const PosteriorProblem& problem, Index n, Random& random) {
  PosteriorSample out;
  out.log_prior.resize(n);
  out.log_likelihood.resize(n);
  for (Index i = 0; i < n; ++i) {
    const VectorXd x = problem.draw_prior(random);
    if (i == 0) out.draws.resize(x.size(), n);
    out.draws.col(i) = x;
    out.log_prior[i] = problem.log_prior(x);
    out.log_likelihood[i] = problem.log_likelihood(x);
    ++out.summary.evaluations;
  }
  return out;
}

// How many columns differ from all others.
Index count_distinct(const MatrixXd& draws) {
  std::vector<Index> order(draws.cols());
  std::iota(order.begin(), order.end(), Index{0});
  const auto less = [&](Index a, Index b) {
    return std::lexicographical_compare(draws.col(a).begin(), draws.col(a).end(),
                                        draws.col(b).begin(), draws.col(b).end());
  };
  std::sort(order.begin(), order.end(), less);
  Index out = order.empty() ? 0 : 1;
  for (std::size_t i = 1; i < order.size(); ++i) out += less(order[i - 1], order[i]);
  return out;
}

// Weighs the draws by the likelihood to the power of `step`, and keeps them in proportion.
void resample(PosteriorSample& out, double step, Random& random) {
  const VectorXd w = tempered_weights(out.log_likelihood, step);
  out.log_evidence += step * out.log_likelihood.maxCoeff() + std::log(w.mean());
  const std::vector<Index> kept = resampled(w, random);
  out.draws = MatrixXd(out.draws(Eigen::all, kept));
  out.log_prior = VectorXd(out.log_prior(kept));
  out.log_likelihood = VectorXd(out.log_likelihood(kept));
}

// One random-walk Metropolis step of every draw; the share that moved.
double move_draws(const PosteriorProblem& problem, double temperature, const MatrixXd& L,
                  double scale, Random& random, PosteriorSample& out) {
  const Index n = out.draws.cols();
  Index count = 0;
  for (Index i = 0; i < n; ++i) {
    const VectorXd x = out.draws.col(i) + scale * (L * random.normal(out.draws.rows()));
    const double threshold = std::log(random.uniform());
    const double prior = problem.log_prior(x);
    if (!(prior > -kInfinity)) continue;
    const double likelihood = problem.log_likelihood(x);
    ++out.summary.evaluations;
    const double rise =
        prior - out.log_prior[i] + temperature * (likelihood - out.log_likelihood[i]);
    if (!(rise > threshold)) continue;
    out.draws.col(i) = x;
    out.log_prior[i] = prior;
    out.log_likelihood[i] = likelihood;
    ++count;
  }
  return static_cast<double>(count) / static_cast<double>(n);
}

}  // namespace

PosteriorSample sample(const PosteriorProblem& problem, const SampleOptions& options) {
  constexpr int kMostMoves = 50;
  // Accepted by every draw, on average: in a stage, and at the end, where copies of one draw have
  // to part.
  constexpr double kInStage = 3.0, kAtTheEnd = 10.0;
  if (options.draws < 10) throw std::invalid_argument("sample: fewer than 10 draws");
  const auto begin = std::chrono::steady_clock::now();
  const auto seconds = [&begin] {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  };
  Random random(options.seed);
  PosteriorSample out = draw_prior(problem, options.draws, random);
  const auto finish = [&](Termination termination, const char* message) {
    out.summary.termination = termination;
    out.summary.message = message;
    out.distinct = count_distinct(out.draws);
    return out;
  };
  if (!(out.log_likelihood.maxCoeff() > -kInfinity)) {
    return finish(Termination::no_progress,
                  "the likelihood is undefined at every draw of the prior");
  }
  double temperature = 0.0, scale = 2.38 / std::sqrt(static_cast<double>(out.draws.rows()));
  while (temperature < 1.0) {
    const double step = next_step(out.log_likelihood, 1.0 - temperature);
    if (!(temperature + step > temperature)) {
      return finish(Termination::no_progress,
                    "no draw of the prior is near enough to what the likelihood asks for");
    }
    resample(out, step, random);
    temperature = step >= 1.0 - temperature ? 1.0 : temperature + step;
    const MatrixXd L = spread(out.draws);
    const double wanted = temperature < 1.0 ? kInStage : kAtTheEnd;
    double accepted = 0.0;
    for (int move = 0; move < kMostMoves && accepted < wanted; ++move) {
      const double rate = move_draws(problem, temperature, L, scale, random, out);
      accepted += rate;
      scale *= std::clamp(std::exp(rate - 0.3), 0.6, 1.6);
      if (options.moved && !options.moved(temperature)) {
        return finish(Termination::stopped, "stopped by the caller");
      }
      if (seconds() <= options.max_seconds) continue;
      if (temperature == 1.0) break;  // the draws are of the posterior, if not far apart
      return finish(Termination::time_limit, "the time limit was reached");
    }
    ++out.stages;
    ++out.summary.iterations;
    if (options.progress && !options.progress(temperature)) {
      return finish(Termination::stopped, "stopped by the caller");
    }
  }
  return finish(Termination::converged, "the posterior is reached");
}

}  // namespace identikal
