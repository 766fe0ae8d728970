#include "identify/noise/bayes.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <string>

#include <fmt/format.h>

#include "identify/estimate/parameter_table.h"
#include "identify/filter/recordings_check.h"
#include "identify/filter/recordings_likelihood.h"
#include "identify/filter/report.h"
#include "identify/model/check.h"
#include "identify/model/parameter_prior.h"
#include "identify/noise/estimate.h"
#include "lib/base/constants.h"
#include "lib/base/random.h"
#include "solvers/sample.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

using Density = std::function<double(const VectorXd&)>;  // log of it

// One or two coordinates. The box is drawn in to where the density is, then finely divided.
PosteriorPoints on_grid(const ParameterPrior& prior, const Density& log_density) {
  constexpr Index kCoarse = 40, kFine = 160;
  constexpr double kDepth = 16.0;  // e^-16 of the highest density: beyond lies less than 1e-5
  const auto k = static_cast<Index>(prior.coordinates.size());
  VectorXd low(k), high(k);
  for (Index i = 0; i < k; ++i) {
    const PriorCoordinate& c = prior.coordinates[i];
    const bool normal = c.kind == PriorCoordinate::Kind::normal;
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
    if (!(highest > -kInfinity)) {
      out.summary.termination = Termination::no_progress;
      out.summary.message = "the likelihood is undefined all over the prior";
      return out;
    }
    if (round == kLast) {
      out.weight = (out.log_density.array() - highest).exp();
      // The prior's density over the whole box, and the box's share in the integral.
      double normaliser = 0.0;
      for (const PriorCoordinate& c : prior.coordinates) {
        normaliser += c.kind == PriorCoordinate::Kind::normal
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

PosteriorPoints by_sampling(const ParameterPrior& prior, const Density& log_likelihood,
                            const NoiseBayesOptions& options) {
  PosteriorProblem problem;
  problem.draw_prior = [&prior](Random& random) { return prior.draw(random); };
  problem.log_prior = [&prior](const VectorXd& x) { return prior.log_density(x); };
  problem.log_likelihood = log_likelihood;
  SampleOptions sampling;
  sampling.draws = options.draws;
  sampling.seed = options.seed;
  sampling.progress = options.progress;
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

// Where the weights of sorted values reach p. Not lib/base/quantile.h: a point of the posterior
// stands at the middle of its weight, so that of equal weights this is Hyndman & Fan's type 5; type
// 7 has no form for weights that are not equal.
double weighted_quantile(const Eigen::Ref<const VectorXd>& value, const VectorXd& weight,
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

PosteriorPoints posterior(const Model& model, const std::vector<Dataset>& recordings,
                          const NoiseBayesOptions& options) {
  const ParameterPrior prior = parameter_prior(model);
  RecordingsLikelihood likelihood(model, recordings);
  const Density log_likelihood = [&](const VectorXd& x) {
    const Likelihood* at = likelihood.evaluate(
        with_entries(model.parameters, entries_at(prior, model.parameters, x)), false);
    return at == nullptr ? -kInfinity : at->value;
  };
  const bool grid = options.grid && prior.coordinates.size() <= 2;
  PosteriorPoints out =
      grid ? on_grid(prior,
                     [&](const VectorXd& x) { return prior.log_density(x) + log_likelihood(x); })
           : by_sampling(prior, log_likelihood, options);
  out.entries.resize(out.coordinates.rows(), out.coordinates.cols());
  for (Index p = 0; p < out.coordinates.cols(); ++p) {
    out.entries.col(p) = entries_at(prior, model.parameters, out.coordinates.col(p));
  }
  return out;
}

Posterior report_posterior(Estimate& estimate, const Model& model, const PosteriorPoints& points,
                           const std::string& method) {
  constexpr double kAsWide = 0.9;   // of the prior's standard deviation
  constexpr double kAtEdge = 0.02;  // of the prior's range
  const ParameterPrior prior = parameter_prior(model);
  const VectorXd mean = points.entries * points.weight;
  list_parameters(estimate, model.parameters, with_entries(model.parameters, mean));
  const MatrixXd centred = points.entries.colwise() - mean;
  const MatrixXd covariance = centred * points.weight.asDiagonal() * centred.transpose();
  const VectorXd sd = covariance.diagonal().cwiseSqrt();
  const VectorXd coordinate_mean = points.coordinates * points.weight;
  Index most_probable = 0;
  points.log_density.maxCoeff(&most_probable);

  Posterior report;
  report.method = method;
  report.points = points.weight.size();
  report.effective = points.effective;
  report.log_evidence = points.log_evidence;
  Identifiability& id = estimate.identifiability;
  Index i = 0;
  for (EstimatedParameter& p : estimate.parameters) {
    Posterior::Parameter& out = report.parameters.emplace_back();
    out.name = p.name;
    if (p.fixed) continue;
    const double unit = unit_scale(p.unit);
    const VectorXd value = points.entries.row(i).transpose();
    std::vector<Index> order(static_cast<std::size_t>(value.size()));
    std::iota(order.begin(), order.end(), 0);
    std::sort(order.begin(), order.end(),
              [&value](Index a, Index b) { return value[a] < value[b]; });
    p.se = sd[i] / unit;
    p.ci95 = {weighted_quantile(value, points.weight, order, 0.025) / unit,
              weighted_quantile(value, points.weight, order, 0.975) / unit};
    const Eigen::ArrayXd spread =
        points.coordinates.row(i).transpose().array() - coordinate_mean[i];
    const double width = std::sqrt((spread.square() * points.weight.array()).sum());
    const auto at = static_cast<std::size_t>(i);
    if (width > kAsWide * prior.coordinates[at].deviation()) {
      p.verdict = Verdict::not_identifiable;
    } else if (p.se > 0.25 * std::abs(p.value)) {
      p.verdict = Verdict::poorly_determined;
    }
    const PriorCoordinate& coordinate = prior.coordinates[at];
    const double range = coordinate.high - coordinate.low;
    const double to_edge =
        std::min(coordinate_mean[i] - coordinate.low, coordinate.high - coordinate_mean[i]);
    if (coordinate.kind == PriorCoordinate::Kind::uniform && to_edge < kAtEdge * range &&
        width < kAtEdge * range) {
      p.verdict = Verdict::at_bound;
    }
    id.rank += p.verdict != Verdict::not_identifiable;
    out.map = points.entries(i, most_probable) / unit;
    out.prior = prior.coordinates[at].words;
    estimate.correlation_names.push_back(p.name);
    ++i;
  }
  id.of = static_cast<int>(i);
  estimate.correlation =
      sd.cwiseInverse().asDiagonal() * covariance * sd.cwiseInverse().asDiagonal();
  estimate.covariance_kind = "the posterior";
  return report;
}

Findings check_priors(const Estimate& estimate, const Posterior& posterior) {
  Findings out;
  for (std::size_t i = 0; i < estimate.parameters.size(); ++i) {
    const EstimatedParameter& p = estimate.parameters[i];
    if (p.fixed || p.verdict != Verdict::at_bound) continue;
    out.push_back(make_finding(
        FindingCode::prior_edge, {p.name},
        fmt::format("the posterior of {} is piled up against the edge of its prior ({})", p.name,
                    posterior.parameters[i].prior),
        "widen the prior, or check the units of the recording"));
  }
  return out;
}

NoiseEstimate tune_bayes(const Model& given, const std::vector<Dataset>& recordings,
                         const NoiseBayesOptions& options) {
  const Model model = checked(given, recordings);
  check_recordings(model, recordings);
  const PosteriorPoints points = posterior(model, recordings, options);
  if (!points.summary.usable()) {
    refuse_filter(model, recordings, RecordingsLikelihood(model, recordings).status_at_start());
  }
  NoiseEstimate estimate;
  estimate.model_name = model.name;
  estimate.objective.method = "bayes";
  estimate.objective.evaluations = points.summary.evaluations;
  const bool grid = options.grid && points.coordinates.rows() <= 2;
  estimate.posterior =
      report_posterior(estimate, model, points, grid ? "grid" : "sequential Monte Carlo");
  append(estimate.findings, check_priors(estimate, *estimate.posterior));
  append(estimate.findings, check_search(estimate, points.summary, " beyond their priors"));
  const ParameterSet end = with_entries(model.parameters, points.entries * points.weight);
  report_noise_estimate(estimate, model, end, recordings);
  conclude(estimate, "converged");
  return estimate;
}

}  // namespace identikal
