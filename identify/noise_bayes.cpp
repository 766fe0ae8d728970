#include "identify/noise_bayes.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <string>

#include <fmt/format.h>

#include "identify/filter_report.h"
#include "identify/noise_estimate.h"
#include "identify/recordings_likelihood.h"
#include "lib/random.h"
#include "solvers/sample.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kNowhere = -std::numeric_limits<double>::infinity();

// One coordinate of the posterior and its prior, which is uniform on [low, high], normal, or that
// of a partial correlation, (1 - x^2)^(shape - 1) on (-1, 1).
struct Coordinate {
  enum class Kind { uniform, normal, partial_correlation };
  Kind kind = Kind::uniform;
  bool logarithm = false;
  double low = kNowhere, high = -kNowhere;  // of the coordinate, bounds included
  double mean = 0.0, sd = 0.0;              // normal
  double shape = 1.0;                       // partial correlation

  double draw(Random& random) const {
    switch (kind) {
      case Kind::uniform:
        return low + (high - low) * random.uniform();
      case Kind::normal:
        for (;;) {
          const double x = mean + sd * random.normal();
          if (low <= x && x <= high) return x;
        }
      case Kind::partial_correlation: {
        // One coordinate of a point on the sphere in 2 shape + 1 dimensions.
        const VectorXd z = random.normal(static_cast<Index>(std::lround(2.0 * shape)) + 1);
        return z[0] / z.norm();
      }
    }
    return 0.0;
  }
  double log_density(double x) const {
    if (!(low <= x && x <= high)) return kNowhere;
    switch (kind) {
      case Kind::uniform:
        return 0.0;
      case Kind::normal:
        return -0.5 * std::pow((x - mean) / sd, 2);
      case Kind::partial_correlation:
        return (shape - 1.0) * std::log1p(-x * x);
    }
    return 0.0;
  }
  double deviation() const {
    switch (kind) {
      case Kind::uniform:
        return (high - low) / std::sqrt(12.0);
      case Kind::normal:
        return sd;
      case Kind::partial_correlation:
        return 1.0 / std::sqrt(2.0 * shape + 1.0);
    }
    return 0.0;
  }
};

Coordinate number(const Prior& prior, double min, double max) {
  Coordinate out;
  const bool logarithm =
      prior.kind == Prior::Kind::log_uniform || prior.kind == Prior::Kind::log_normal;
  const auto scaled = [logarithm](double x) { return logarithm ? std::log(x) : x; };
  out.logarithm = logarithm;
  out.low = logarithm && min <= 0.0 ? kNowhere : scaled(min);
  out.high = scaled(max);
  switch (prior.kind) {
    case Prior::Kind::none:
      break;
    case Prior::Kind::uniform:
    case Prior::Kind::log_uniform:
      out.low = std::max(out.low, scaled(prior.a));
      out.high = std::min(out.high, scaled(prior.b));
      break;
    case Prior::Kind::normal:
      out.kind = Coordinate::Kind::normal;
      out.mean = prior.a;
      out.sd = prior.b;
      break;
    case Prior::Kind::log_normal:
      out.kind = Coordinate::Kind::normal;
      out.mean = std::log(prior.a);
      out.sd = std::log(prior.b);
      break;
  }
  return out;
}

// The prior that is used where the model file gives none.
Prior prior_of(const ModelFile& model, const Parameter& p, double start, bool variance) {
  constexpr double kDecades = 1e4;
  if (p.prior.kind != Prior::Kind::none) return p.prior;
  if (variance && start > 0.0) {
    return {Prior::Kind::log_uniform, start / kDecades, start * kDecades};
  }
  if (std::isfinite(p.min) && std::isfinite(p.max)) return {Prior::Kind::uniform, p.min, p.max};
  throw InputError({model.path, 0, 0},
                   fmt::format("parameter '{}' has no prior, and none follows from its {}", p.name,
                               variance ? "start, which is zero" : "bounds"),
                   "prior: {uniform: [LOW, HIGH]}, {normal: {mean: M, sd: S}} or, for a variance, "
                   "{log-uniform: [LOW, HIGH]}");
}

std::string in_words(const Prior& prior) {
  switch (prior.kind) {
    case Prior::Kind::none:
      return "";
    case Prior::Kind::uniform:
      return fmt::format("uniform {:.4g} .. {:.4g}", prior.a, prior.b);
    case Prior::Kind::log_uniform:
      return fmt::format("log-uniform {:.4g} .. {:.4g}", prior.a, prior.b);
    case Prior::Kind::normal:
      return fmt::format("normal {:.4g} +- {:.4g}", prior.a, prior.b);
    case Prior::Kind::log_normal:
      return fmt::format("log-normal {:.4g} within a factor {:.4g}", prior.a, prior.b);
  }
  return "";
}

// Free parameters by independent coordinates.
struct Space {
  const ParameterSet& parameters;
  std::vector<Coordinate> coordinates;
  std::vector<std::string> words;  // of the prior, one per coordinate

  explicit Space(const ModelFile& model) : parameters(model.parameters) {
    const ReportedEntries all = reported_entries(parameters);
    for (std::size_t e = 0; e < all.names.size(); ++e) {
      const Parameter& p = parameters[static_cast<std::size_t>(all.parameter[e])];
      if (p.fixed) continue;
      const double value = all.value[static_cast<Index>(e)];
      const bool full = p.domain == Domain::positive_definite;
      if (full && !all.variance[e]) {
        Coordinate partial;
        partial.kind = Coordinate::Kind::partial_correlation;
        partial.low = -1.0;
        partial.high = 1.0;
        coordinates.push_back(partial);
        words.emplace_back("uniform over correlation matrices");
        continue;
      }
      const bool scalar = p.domain == Domain::scalar;
      const Prior prior = prior_of(model, p, value, all.variance[e]);
      coordinates.push_back(number(prior, scalar ? p.min : 0.0,
                                   scalar ? p.max : std::numeric_limits<double>::infinity()));
      words.push_back(in_words(prior));
    }
    // Of a full matrix, column by column: the variance, then the partial correlations below it.
    std::size_t at = 0;
    for (const Parameter& p : parameters) {
      if (p.fixed) continue;
      const Index n = p.value.rows();
      if (p.domain != Domain::positive_definite) {
        at += static_cast<std::size_t>(free_entries({p}).size());
        continue;
      }
      for (Index j = 0; j < n; ++j) {
        for (Index i = j; i < n; ++i, ++at) {
          if (i > j) coordinates[at].shape = 1.0 + 0.5 * static_cast<double>(n - 2 - j);
        }
      }
    }
  }

  double log_prior(const VectorXd& x) const {
    double out = 0.0;
    for (std::size_t i = 0; i < coordinates.size(); ++i) {
      out += coordinates[i].log_density(x[static_cast<Index>(i)]);
    }
    return out;
  }

  VectorXd draw(Random& random) const {
    VectorXd out(static_cast<Index>(coordinates.size()));
    for (Index i = 0; i < out.size(); ++i) {
      out[i] = coordinates[static_cast<std::size_t>(i)].draw(random);
    }
    return out;
  }

  VectorXd entries(const VectorXd& x) const {
    VectorXd out = x;
    for (Index i = 0; i < x.size(); ++i) {
      if (coordinates[static_cast<std::size_t>(i)].logarithm) out[i] = std::exp(x[i]);
    }
    Index at = 0;
    for (const Parameter& p : parameters) {
      if (p.fixed) continue;
      const Index n = p.value.rows();
      if (p.domain != Domain::positive_definite) {
        at += free_entries({p}).size();
        continue;
      }
      // Factor of the correlation matrix, row by row from partial correlations.
      MatrixXd L = MatrixXd::Zero(n, n);
      VectorXd sd(n), rest = VectorXd::Ones(n);
      const Index first = at;
      for (Index j = 0; j < n; ++j) {
        sd[j] = std::sqrt(out[at++]);
        L(j, j) = std::sqrt(rest[j]);
        for (Index i = j + 1; i < n; ++i) {
          L(i, j) = out[at++] * std::sqrt(rest[i]);
          rest[i] -= L(i, j) * L(i, j);
        }
      }
      const MatrixXd V = sd.asDiagonal() * L * L.transpose() * sd.asDiagonal();
      at = first;
      for (Index j = 0; j < n; ++j) {
        for (Index i = j; i < n; ++i) out[at++] = V(i, j);
      }
    }
    return out;
  }
};

using Density = std::function<double(const VectorXd&)>;  // log of it

// One or two coordinates. The box is drawn in to where the density is, then finely divided.
PosteriorPoints on_grid(const Space& space, const Density& log_density) {
  constexpr Index kCoarse = 40, kFine = 160;
  constexpr double kDepth = 16.0;  // e^-16 of the highest density: beyond lies less than 1e-5
  const auto k = static_cast<Index>(space.coordinates.size());
  VectorXd low(k), high(k);
  for (Index i = 0; i < k; ++i) {
    const Coordinate& c = space.coordinates[static_cast<std::size_t>(i)];
    const bool normal = c.kind == Coordinate::Kind::normal;
    low[i] = normal ? std::max(c.low, c.mean - 8.0 * c.sd) : c.low;
    high[i] = normal ? std::min(c.high, c.mean + 8.0 * c.sd) : c.high;
  }
  PosteriorPoints out;
  for (int round = 0;; ++round) {
    constexpr int kLast = 4;
    const Index side = round == kLast ? kFine : kCoarse;
    const Index count = k == 1 ? side : side * side;
    const VectorXd pitch = (high - low) / static_cast<double>(side);
    out.coordinates.resize(k, count);
    out.log_density.resize(count);
    for (Index p = 0; p < count; ++p) {
      for (Index i = 0; i < k; ++i) {
        const Index cell = i == 0 ? p % side : p / side;
        out.coordinates(i, p) = low[i] + (static_cast<double>(cell) + 0.5) * pitch[i];
      }
      out.log_density[p] = log_density(out.coordinates.col(p));
      ++out.summary.evaluations;
    }
    const double highest = out.log_density.maxCoeff();
    if (!(highest > kNowhere)) {
      out.summary.termination = Termination::no_progress;
      out.summary.message = "the likelihood is undefined all over the prior";
      return out;
    }
    if (round == kLast) {
      out.weight = (out.log_density.array() - highest).exp();
      // The prior's density over the whole box, and the box's share in the integral.
      double normaliser = 0.0;
      for (const Coordinate& c : space.coordinates) {
        normaliser += c.kind == Coordinate::Kind::normal
                          ? std::log(c.sd * std::sqrt(2.0 * std::numbers::pi))
                          : std::log(c.high - c.low);
      }
      out.log_evidence =
          highest + std::log(out.weight.sum()) + pitch.array().log().sum() - normaliser;
      out.weight /= out.weight.sum();
      break;
    }
    VectorXd inner_low = high, inner_high = low;
    for (Index p = 0; p < count; ++p) {
      if (out.log_density[p] < highest - kDepth) continue;
      inner_low = inner_low.cwiseMin(out.coordinates.col(p));
      inner_high = inner_high.cwiseMax(out.coordinates.col(p));
    }
    low = low.cwiseMax(inner_low - 1.5 * pitch);
    high = high.cwiseMin(inner_high + 1.5 * pitch);
  }
  out.effective = 1.0 / out.weight.squaredNorm();
  out.summary.termination = Termination::converged;
  out.summary.message = "the posterior is summed on a grid";
  return out;
}

PosteriorPoints by_sampling(const Space& space, const Density& log_likelihood,
                            const NoiseBayesOptions& options) {
  PosteriorProblem problem;
  problem.draw_prior = [&space](Random& random) { return space.draw(random); };
  problem.log_prior = [&space](const VectorXd& x) { return space.log_prior(x); };
  problem.log_likelihood = log_likelihood;
  SampleOptions sampling;
  sampling.draws = options.draws;
  sampling.seed = options.seed;
  if (options.progress) {
    sampling.progress = [&options](double temperature) {
      options.progress(temperature);
      return true;
    };
  }
  const PosteriorSample drawn = sample(problem, sampling);
  PosteriorPoints out;
  out.coordinates = drawn.draws;
  out.weight =
      VectorXd::Constant(drawn.draws.cols(), 1.0 / static_cast<double>(drawn.draws.cols()));
  out.log_density = drawn.log_prior + drawn.log_likelihood;
  out.log_evidence = drawn.log_evidence;
  out.effective = static_cast<double>(drawn.distinct);
  out.summary = drawn.summary;
  return out;
}

// Where the weights of sorted values reach p.
double quantile(const Eigen::Ref<const VectorXd>& value, const VectorXd& weight,
                const std::vector<Index>& order, double p) {
  double sum = 0.0, before = 0.0, at = value[order.front()];
  for (const Index i : order) {
    const double middle = sum + 0.5 * weight[i];
    if (middle >= p) {
      return middle > before ? at + (value[i] - at) * (p - before) / (middle - before) : value[i];
    }
    sum += weight[i];
    before = middle;
    at = value[i];
  }
  return value[order.back()];
}

}  // namespace

PosteriorPoints posterior(const ModelFile& model, const std::vector<Dataset>& recordings,
                          const NoiseBayesOptions& options) {
  const Space space(model);
  RecordingsLikelihood likelihood(model, recordings);
  const Density log_likelihood = [&](const VectorXd& x) {
    const Likelihood* at =
        likelihood.evaluate(with_entries(model.parameters, space.entries(x)), false);
    return at == nullptr ? kNowhere : at->value;
  };
  const bool grid = options.grid && space.coordinates.size() <= 2;
  PosteriorPoints out =
      grid ? on_grid(space,
                     [&](const VectorXd& x) { return space.log_prior(x) + log_likelihood(x); })
           : by_sampling(space, log_likelihood, options);
  out.entries.resize(out.coordinates.rows(), out.coordinates.cols());
  for (Index p = 0; p < out.coordinates.cols(); ++p) {
    out.entries.col(p) = space.entries(out.coordinates.col(p));
  }
  return out;
}

Estimate tune_bayes(const ModelFile& model, const std::vector<Dataset>& recordings,
                    const NoiseBayesOptions& options) {
  constexpr double kAsWide = 0.9;  // of the prior's standard deviation
  check_recordings(model, recordings);
  const Space space(model);
  const PosteriorPoints points = posterior(model, recordings, options);
  Estimate estimate;
  estimate.model_name = model.name;
  estimate.objective.method = "bayes";
  estimate.objective.evaluations = points.summary.evaluations;
  if (!points.summary.usable()) {
    refuse_filter(model, recordings, RecordingsLikelihood(model, recordings).status_at_start());
  }
  const VectorXd mean = points.entries * points.weight;
  const ParameterSet end = with_entries(model.parameters, mean);
  list_parameters(estimate, model.parameters, end);
  const MatrixXd centred = points.entries.colwise() - mean;
  const MatrixXd covariance = centred * points.weight.asDiagonal() * centred.transpose();
  const VectorXd sd = covariance.diagonal().cwiseSqrt();
  const VectorXd coordinate_mean = points.coordinates * points.weight;
  Index most_probable = 0;
  points.log_density.maxCoeff(&most_probable);

  Posterior& report = estimate.posterior.emplace();
  report.method = options.grid && space.coordinates.size() <= 2 ? "grid" : "sequential Monte Carlo";
  report.points = points.weight.size();
  report.effective = points.effective;
  report.log_evidence = points.log_evidence;
  Identifiability& id = estimate.identifiability;
  Index i = 0;
  for (EstimatedParameter& p : estimate.parameters) {
    report.map.push_back(kNone);
    report.prior.emplace_back();
    if (p.fixed) continue;
    const double unit = unit_scale(p.unit);
    const VectorXd value = points.entries.row(i).transpose();
    std::vector<Index> order(static_cast<std::size_t>(value.size()));
    std::iota(order.begin(), order.end(), 0);
    std::sort(order.begin(), order.end(),
              [&value](Index a, Index b) { return value[a] < value[b]; });
    p.se = sd[i] / unit;
    p.ci95 = {quantile(value, points.weight, order, 0.025) / unit,
              quantile(value, points.weight, order, 0.975) / unit};
    const Eigen::ArrayXd spread =
        points.coordinates.row(i).transpose().array() - coordinate_mean[i];
    const double width = std::sqrt((spread.square() * points.weight.array()).sum());
    const auto at = static_cast<std::size_t>(i);
    if (width > kAsWide * space.coordinates[at].deviation()) {
      p.verdict = Verdict::flat;
    } else if (p.se > 0.25 * std::abs(p.value)) {
      p.verdict = Verdict::weak;
    }
    id.rank += p.verdict != Verdict::flat;
    report.map.back() = points.entries(i, most_probable) / unit;
    report.prior.back() = space.words[at];
    estimate.correlation_names.push_back(p.name);
    ++i;
  }
  id.of = static_cast<int>(i);
  estimate.correlation =
      sd.cwiseInverse().asDiagonal() * covariance * sd.cwiseInverse().asDiagonal();
  estimate.covariance_kind = "the posterior";
  conclude_noise_estimate(estimate, points.summary);
  if (id.rank < id.of) estimate.message += " beyond their priors";
  describe_noise_estimate(estimate, model, end, recordings);
  return estimate;
}

}  // namespace identikal
