#include "identify/noise/internal/importance_sample.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>

#include "lib/base/constants.h"
#include "lib/base/random.h"
#include "solvers/scoring.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kStarts = 5, kSampleRounds = 6;
constexpr double kDof = 5.0, kPriorShare = 0.1;

// d entries / d coordinates.
MatrixXd entries_jacobian(const Model& model, const ParameterPrior& prior, const VectorXd& x) {
  MatrixXd out(x.size(), x.size());
  for (Index i = 0; i < x.size(); ++i) {
    const VectorXd step = 1e-6 * std::max(1.0, std::abs(x[i])) * VectorXd::Unit(x.size(), i);
    out.col(i) = (entries_at(prior, model.parameters, x + step) -
                  entries_at(prior, model.parameters, x - step)) /
                 (2.0 * step[i]);
  }
  return out;
}

// Slope and curvature of a coordinate's log-density.
std::pair<double, double> prior_slope(const PriorCoordinate& c, double x) {
  switch (c.kind) {
    case PriorCoordinate::Kind::uniform:
      break;
    case PriorCoordinate::Kind::normal:
      return {-(x - c.mean) / (c.sd * c.sd), 1.0 / (c.sd * c.sd)};
    case PriorCoordinate::Kind::partial_correlation: {
      const double scale = 2.0 * (c.shape - 1.0) / (1.0 - x * x);
      return {-scale * x, scale};
    }
  }
  return {0.0, 0.0};
}

// Likelihood times prior by the prior's coordinates.
LikelihoodProblem posterior_problem(const Model& model, const ParameterPrior& prior,
                                    RecordingsLikelihood& likelihood) {
  constexpr double kMostCorrelation = 0.999;
  const auto k = static_cast<Index>(prior.coordinates.size());
  LikelihoodProblem out;
  out.lower.resize(k);
  out.upper.resize(k);
  for (Index i = 0; i < k; ++i) {
    const PriorCoordinate& c = prior.coordinates[static_cast<std::size_t>(i)];
    const bool partial = c.kind == PriorCoordinate::Kind::partial_correlation;
    out.lower[i] = partial ? -kMostCorrelation : c.low;
    out.upper[i] = partial ? kMostCorrelation : c.high;
  }
  out.evaluate = [&model, &prior, &likelihood, k](const VectorXd& x, double& L, VectorXd* gradient,
                                                  MatrixXd* information) {
    const ParameterSet at = with_entries(model.parameters, entries_at(prior, model.parameters, x));
    const Likelihood* data = likelihood.evaluate(at, gradient != nullptr);
    if (data == nullptr) return false;
    L = data->value + prior.log_density(x);
    if (gradient == nullptr) return std::isfinite(L);
    const MatrixXd J = entries_jacobian(model, prior, x);
    *gradient = J.transpose() * data->gradient;
    if (information != nullptr) *information = J.transpose() * data->information * J;
    for (Index i = 0; i < k; ++i) {
      const auto [slope, curvature] =
          prior_slope(prior.coordinates[static_cast<std::size_t>(i)], x[i]);
      (*gradient)[i] += slope;
      if (information != nullptr) (*information)(i, i) += curvature;
    }
    return std::isfinite(L);
  };
  return out;
}

// Where the model file starts: variances and numbers as they are, and no correlation.
VectorXd start_of(const Model& model, const ParameterPrior& prior) {
  const VectorXd entries = free_entries(model.parameters);
  VectorXd out(entries.size());
  for (Index i = 0; i < out.size(); ++i) {
    const PriorCoordinate& c = prior.coordinates[static_cast<std::size_t>(i)];
    out[i] = c.logarithm ? std::log(std::max(entries[i], 1e-300)) : entries[i];
    if (c.kind == PriorCoordinate::Kind::partial_correlation) out[i] = 0.0;
  }
  return out;
}

// Student's t about a point.
struct Part {
  VectorXd mean;
  MatrixXd L;  // of its scale matrix

  VectorXd draw(Random& random) const {
    const double chi_square = random.normal(static_cast<Index>(kDof)).squaredNorm();
    return mean + std::sqrt(kDof / chi_square) * (L * random.normal(mean.size()));
  }
  double log_density(const VectorXd& x) const {
    const auto k = static_cast<double>(mean.size());
    const double distance = L.triangularView<Eigen::Lower>().solve(x - mean).squaredNorm();
    return std::lgamma(0.5 * (kDof + k)) - std::lgamma(0.5 * kDof) -
           0.5 * k * std::log(kDof * std::numbers::pi) - L.diagonal().array().log().sum() -
           0.5 * (kDof + k) * std::log1p(distance / kDof);
  }
};

// The prior's own width bounds what the data do not determine.
Part part_about(const VectorXd& mean, MatrixXd information, const ParameterPrior& prior) {
  for (Index i = 0; i < mean.size(); ++i) {
    const double width = prior.coordinates[static_cast<std::size_t>(i)].deviation();
    information(i, i) += 1.0 / (width * width);
  }
  const MatrixXd covariance =
      information.ldlt().solve(MatrixXd::Identity(mean.size(), mean.size()));
  return {mean, covariance.llt().matrixL()};
}

std::vector<Part> parts_at_maxima(const Model& model, const ParameterPrior& prior,
                                  const LikelihoodProblem& problem, Random& random,
                                  SolverSummary& summary) {
  constexpr double kNegligible = 15.0;  // nats below the best
  struct Maximum {
    double value;
    VectorXd x;
  };
  std::vector<Maximum> maxima;
  const VectorXd first = start_of(model, prior);
  SolverOptions options;
  options.max_iterations = 50;
  for (int s = 0; s < kStarts; ++s) {
    // A quarter of the way to any draw of the prior.
    const VectorXd start = s == 0 ? first : VectorXd(first + 0.25 * (prior.draw(random) - first));
    const Solution end =
        maximise(problem, start.cwiseMax(problem.lower).cwiseMin(problem.upper), options);
    summary.evaluations += end.summary.evaluations;
    if (std::isfinite(end.summary.objective)) maxima.push_back({end.summary.objective, end.x});
  }
  std::sort(maxima.begin(), maxima.end(),
            [](const Maximum& a, const Maximum& b) { return a.value > b.value; });
  std::vector<Part> out;
  for (const Maximum& each : maxima) {
    if (each.value < maxima.front().value - kNegligible) break;
    double L = 0.0;
    VectorXd gradient;
    MatrixXd information;
    if (!problem.evaluate(each.x, L, &gradient, &information)) continue;
    Part part = part_about(each.x, information, prior);
    const bool known = std::any_of(out.begin(), out.end(), [&](const Part& other) {
      return other.L.triangularView<Eigen::Lower>().solve(each.x - other.mean).norm() < 0.5;
    });
    if (!known && part.L.allFinite()) out.push_back(std::move(part));
  }
  return out;
}

// A tenth of the prior, the rest of the parts alike.
struct PosteriorMixture {
  std::vector<Part> parts;

  VectorXd draw(const ParameterPrior& prior, Random& random) const {
    if (random.uniform() < kPriorShare) return prior.draw(random);
    const auto at = static_cast<std::size_t>(random.uniform() * static_cast<double>(parts.size()));
    return parts[std::min(at, parts.size() - 1)].draw(random);
  }
  double density(const ParameterPrior& prior, const VectorXd& x, double scale) const {
    double out = kPriorShare * std::exp(prior.log_density(x) - scale);
    for (const Part& part : parts) {
      out += (1.0 - kPriorShare) / static_cast<double>(parts.size()) *
             std::exp(part.log_density(x) - scale);
    }
    return out;
  }
};

// Draws of every round, and what they were drawn from.
class Draws {
 public:
  Draws(const ParameterPrior& prior, const LikelihoodProblem& problem)
      : prior_(prior), problem_(problem) {}

  // false: the caller stops it.
  bool add(const PosteriorMixture& mixture, Index count, Random& random,
           const std::function<bool(double)>& progress, SolverSummary& summary) {
    mixtures_.push_back(mixture);
    for (Index i = 0; i < count; ++i) {
      VectorXd x = mixture.draw(prior_, random);
      double L = -kInfinity;
      if (std::isfinite(prior_.log_density(x))) {
        ++summary.evaluations;
        if (!problem_.evaluate(x, L, nullptr, nullptr)) L = -kInfinity;
      }
      points_.push_back(std::move(x));
      log_density_.push_back(L);
      const auto done = static_cast<double>(points_.size());
      if (progress && i % 20 == 0 && !progress(done / (done + static_cast<double>(count)))) {
        return false;
      }
    }
    return true;
  }

  // All draws, weighed by the mean of all mixtures: every round has as many draws.
  PosteriorPoints weighed(const Model& model) const {
    PosteriorPoints out;
    const auto n = static_cast<Index>(points_.size());
    out.coordinates.resize(points_.front().size(), n);
    out.entries.resize(points_.front().size(), n);
    out.log_density = Eigen::Map<const VectorXd>(log_density_.data(), n);
    VectorXd log_weight = VectorXd::Constant(n, -kInfinity);
    for (Index i = 0; i < n; ++i) {
      const VectorXd& x = points_[static_cast<std::size_t>(i)];
      out.coordinates.col(i) = x;
      out.entries.col(i) = entries_at(prior_, model.parameters, x);
      if (!std::isfinite(out.log_density[i])) continue;
      const double scale = prior_.log_density(x);
      double sum = 0.0;
      for (const PosteriorMixture& mixture : mixtures_) sum += mixture.density(prior_, x, scale);
      log_weight[i] =
          out.log_density[i] - scale - std::log(sum / static_cast<double>(mixtures_.size()));
    }
    const double largest = log_weight.maxCoeff();
    if (!std::isfinite(largest)) return out;
    out.weight = (log_weight.array() - largest).exp();
    out.log_evidence = largest + std::log(out.weight.mean());
    out.weight /= out.weight.sum();
    out.effective = 1.0 / out.weight.squaredNorm();
    return out;
  }

 private:
  const ParameterPrior& prior_;
  const LikelihoodProblem& problem_;
  std::vector<VectorXd> points_;
  std::vector<double> log_density_;
  std::vector<PosteriorMixture> mixtures_;
};

// Fitted to the draws as they are weighed.
Part fitted_part(const PosteriorPoints& points, const ParameterPrior& prior) {
  const VectorXd mean = points.coordinates * points.weight;
  const MatrixXd centred = points.coordinates.colwise() - mean;
  MatrixXd covariance = centred * points.weight.asDiagonal() * centred.transpose();
  for (Index i = 0; i < mean.size(); ++i) {
    const double width = prior.coordinates[static_cast<std::size_t>(i)].deviation();
    covariance(i, i) += 1e-6 * width * width;
  }
  return {mean, covariance.llt().matrixL()};
}

}  // namespace

std::optional<PosteriorPoints> importance_sample(const Model& model, const ParameterPrior& prior,
                                                 RecordingsLikelihood& likelihood,
                                                 const NoiseBayesOptions& options) {
  const LikelihoodProblem problem = posterior_problem(model, prior, likelihood);
  const auto begin = std::chrono::steady_clock::now();
  const auto is_late = [&] {
    const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - begin;
    return spent.count() > options.max_seconds;
  };
  const auto goes_on = [&](double share) {
    return !is_late() && (!options.progress || options.progress(share));
  };
  Random random(options.seed);
  SolverSummary summary;
  PosteriorMixture mixture{parts_at_maxima(model, prior, problem, random, summary)};
  if (mixture.parts.empty()) return std::nullopt;
  Draws draws(prior, problem);
  PosteriorPoints out;
  const auto wanted = static_cast<double>(options.draws);
  for (int round = 0; round < kSampleRounds && out.effective < 0.5 * wanted; ++round) {
    const bool all = draws.add(mixture, options.draws, random, goes_on, summary);
    out = draws.weighed(model);
    if (!all) {
      summary.termination = is_late() ? Termination::time_limit : Termination::stopped;
      summary.message = "stopped by the caller";
      out.summary = summary;
      return out;
    }
    if (out.weight.size() == 0) return std::nullopt;
    mixture.parts.push_back(fitted_part(out, prior));
  }
  if (out.effective < 0.1 * wanted) return std::nullopt;
  summary.termination = Termination::converged;
  summary.message = "the weights of the draws are alike";
  out.summary = summary;
  out.method = "importance sampling";
  return out;
}

}  // namespace identikal
