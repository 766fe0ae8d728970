#include "identify/noise/bayes.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <string>

#include <fmt/format.h>

#include "identify/estimate/parameter_table.h"
#include "identify/filter/recordings_check.h"
#include "identify/filter/recordings_likelihood.h"
#include "identify/filter/report.h"
#include "identify/model/check.h"
#include "identify/model/parameter_prior.h"
#include "identify/noise/estimate.h"
#include "identify/noise/internal/importance_sample.h"
#include "identify/noise/internal/posterior_grid.h"
#include "lib/base/constants.h"
#include "lib/base/random.h"
#include "lib/data/units.h"
#include "solvers/sample.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

using Density = std::function<double(const VectorXd&)>;  // log of it

PosteriorSample drawn_from(const ParameterPrior& prior, const Density& log_likelihood,
                           const SampleOptions& options) {
  PosteriorProblem problem;
  problem.draw_prior = [&prior](Random& random) { return prior.draw(random); };
  problem.log_prior = [&prior](const VectorXd& x) { return prior.log_density(x); };
  problem.log_likelihood = log_likelihood;
  return sample(problem, options);
}

PosteriorPoints points_of(const PosteriorSample& drawn) {
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

// One or two coordinates; some draws show where the posterior is.
std::optional<PosteriorPoints> on_grid(const ParameterPrior& prior, const Density& log_likelihood,
                                       const NoiseBayesOptions& options) {
  SampleOptions pilot;
  pilot.draws = 400;
  pilot.seed = options.seed;
  pilot.max_seconds = options.max_seconds;
  pilot.moved = options.progress;
  const PosteriorSample drawn = drawn_from(prior, log_likelihood, pilot);
  const Termination ended = drawn.summary.termination;
  if (ended == Termination::time_limit || ended == Termination::stopped) return points_of(drawn);
  if (!drawn.summary.usable()) return std::nullopt;
  const auto k = static_cast<Index>(prior.coordinates.size());
  LogDensity density{[&](const VectorXd& x) { return prior.log_density(x) + log_likelihood(x); },
                     VectorXd(k), VectorXd(k)};
  for (Index i = 0; i < k; ++i) {
    density.low[i] = prior.coordinates[i].low;
    density.high[i] = prior.coordinates[i].high;
  }
  const std::optional<PosteriorGrid> grid = posterior_grid(density, drawn.draws);
  if (!grid) return std::nullopt;
  PosteriorPoints out;
  out.coordinates = grid->coordinates;
  out.log_density = grid->log_density;
  out.weight = grid->weight;
  out.log_evidence = grid->log_integral;
  out.effective = 1.0 / out.weight.squaredNorm();
  out.summary.termination = Termination::converged;
  out.summary.message = "the posterior is summed on a grid";
  out.summary.evaluations = drawn.summary.evaluations + grid->evaluations;
  out.on_grid = true;
  out.method = "grid";
  return out;
}

PosteriorPoints by_sampling(const ParameterPrior& prior, const Density& log_likelihood,
                            const NoiseBayesOptions& options) {
  SampleOptions sampling;
  sampling.draws = options.draws;
  sampling.seed = options.seed;
  sampling.max_seconds = options.max_seconds;
  sampling.moved = options.progress;
  return points_of(drawn_from(prior, log_likelihood, sampling));
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
  if (is_formula_model(model)) {
    if (auto weighed = importance_sample(model, prior, likelihood, options)) return *weighed;
  }
  std::optional<PosteriorPoints> summed;
  if (!is_formula_model(model) && options.grid && prior.coordinates.size() <= 2) {
    summed = on_grid(prior, log_likelihood, options);
  }
  PosteriorPoints out = summed ? *summed : by_sampling(prior, log_likelihood, options);
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
    const Unit unit = unit_or_dimensionless(p.unit);
    const VectorXd value = points.entries.row(i).transpose();
    std::vector<Index> order(static_cast<std::size_t>(value.size()));
    std::iota(order.begin(), order.end(), 0);
    std::sort(order.begin(), order.end(),
              [&value](Index a, Index b) { return value[a] < value[b]; });
    p.se = sd[i] / unit.scale;
    p.ci95 = {unit.from_si(weighted_quantile(value, points.weight, order, 0.025)),
              unit.from_si(weighted_quantile(value, points.weight, order, 0.975))};
    const Eigen::ArrayXd spread =
        points.coordinates.row(i).transpose().array() - coordinate_mean[i];
    const double width = std::sqrt((spread.square() * points.weight.array()).sum());
    const auto at = static_cast<std::size_t>(i);
    if (width > kAsWide * prior.coordinates[at].deviation()) {
      p.verdict = Verdict::not_identifiable;
    } else if (relative_error(p) > 0.25) {
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
    out.map = unit.from_si(points.entries(i, most_probable));
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

// Draws on their way from the prior are none of the posterior: there is nothing to estimate from.
NoiseEstimate stopped_at_start(const Model& model, const PosteriorPoints& points,
                               const NoiseBayesOptions& options) {
  NoiseEstimate out;
  out.model_name = model.name;
  out.objective.method = "bayes";
  out.objective.evaluations = points.summary.evaluations;
  list_parameters(out, model.parameters, model.parameters);
  SolverSummary summary = points.summary;
  if (summary.termination == Termination::time_limit) {
    summary.message = fmt::format(
        "the posterior was not reached in {:.0f} s, {} filter runs of {:.2g} ms each: fewer free "
        "parameters, narrower priors, a part of the recording (--range), fewer --draws or a larger "
        "--time-limit; --method ml answers without draws",
        options.max_seconds, summary.evaluations,
        1e3 * options.max_seconds / std::max(1, summary.evaluations));
  }
  append(out.findings, check_search(out, summary));
  conclude(out, "");
  return out;
}

NoiseEstimate tune_bayes(const Model& given, const std::vector<Dataset>& recordings,
                         const NoiseBayesOptions& options) {
  refuse_constraints(given, "bayes");
  const Model model = checked(given, recordings);
  check_recordings(model, recordings);
  const PosteriorPoints points = posterior(model, recordings, options);
  const Termination ended = points.summary.termination;
  if (ended == Termination::stopped || ended == Termination::time_limit) {
    return stopped_at_start(model, points, options);
  }
  if (!points.summary.usable()) {
    refuse_filter(model, recordings, RecordingsLikelihood(model, recordings).status_at_start());
  }
  NoiseEstimate estimate;
  estimate.model_name = model.name;
  estimate.objective.method = "bayes";
  estimate.objective.evaluations = points.summary.evaluations;
  estimate.posterior = report_posterior(estimate, model, points, points.method);
  append(estimate.findings, check_priors(estimate, *estimate.posterior));
  append(estimate.findings, check_search(estimate, points.summary, " beyond their priors"));
  const ParameterSet end = with_entries(model.parameters, points.entries * points.weight);
  report_noise_estimate(estimate, model, end, recordings);
  conclude(estimate, "converged");
  return estimate;
}

}  // namespace identikal
