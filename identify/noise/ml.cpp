#include "identify/noise/ml.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "identify/estimate/constraint_findings.h"
#include "identify/estimate/parameter_table.h"
#include "identify/filter/digest_file.h"
#include "identify/filter/recordings_check.h"
#include "identify/filter/recordings_likelihood.h"
#include "identify/filter/report.h"
#include "identify/model/check.h"
#include "identify/model/own_parameters.h"
#include "identify/model/parameter_prior.h"
#include "identify/model/row_order.h"
#include "identify/model/simulation_model.h"
#include "identify/noise/estimate.h"
#include "identify/noise/internal/coloured_errors.h"
#include "identify/noise/internal/curve_smoothness.h"
#include "identify/noise/internal/equal_maxima.h"
#include "identify/noise/internal/likelihood_errors.h"
#include "identify/noise/internal/likelihood_intervals.h"
#include "identify/noise/internal/several_starts.h"
#include "identify/noise/population_fit.h"
#include "identify/noise/reference_tuning.h"
#include "identify/noise/student.h"
#include "lib/filter/likelihood.h"
#include "solvers/scoring.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr int kIntegrationRefinements = 4;  // of the integration, each with a search of its own
constexpr int kMostTightenings = 20;

// Parameters at their bounds. @param estimate  with the limits of limit_variances_at_zero()
Findings check_bounds(const Estimate& estimate, const LikelihoodProblem& problem,
                      const VectorXd& x) {
  Findings out;
  Index i = -1;
  for (const EstimatedParameter& p : estimate.parameters) {
    if (p.fixed) continue;
    ++i;
    const bool lower = x[i] <= problem.lower[i], upper = x[i] >= problem.upper[i];
    if (!lower && !upper) continue;
    if (lower && problem.lower[i] == 0.0) {
      const std::string limit = std::isnan(p.ci95[1])
                                    ? "and has no upper bound"
                                    : fmt::format("upper bound {:.4g} (95 %)", p.ci95[1]);
      out.push_back(
          make_finding(FindingCode::at_bound, {p.name},
                       fmt::format("{} is not distinguishable from 0, {}", p.name, limit)));
      continue;
    }
    out.push_back(
        {FindingCode::at_bound,
         Severity::warning,
         {p.name},
         fmt::format("{} ended at its {} bound {:.6g}", p.name, lower ? "lower" : "upper", p.value),
         "widen the bound in the model file if it is not physical"});
  }
  return out;
}

// Polynomials with roots on the unit circle.
Findings check_roots(const Estimate& estimate, const std::vector<RootsOnCircle>& on_circle) {
  std::vector<std::string> free;
  for (const EstimatedParameter& p : estimate.parameters) {
    if (!p.fixed) free.push_back(p.name);
  }
  Findings out;
  for (const RootsOnCircle& each : on_circle) {
    std::vector<std::string> names;
    for (const Eigen::Index i : each.entries) names.push_back(free[static_cast<std::size_t>(i)]);
    const std::string all = fmt::format("{}", fmt::join(names, ", "));
    out.push_back(make_finding(
        FindingCode::at_bound, names,
        each.moving_average
            ? fmt::format("the moving average of {} has a root on the unit circle: what it takes "
                          "out, a difference or a season, may have been taken out before",
                          all)
            : fmt::format(
                  "the autoregression of {} has a root at the border of stability: the "
                  "recording may be of something that drifts, with a difference to be taken",
                  all)));
  }
  return out;
}

// What counted beside the data.
void report_priors(Estimate& estimate, const ParameterSet& end) {
  const std::vector<std::string> names = names_with_priors(end);
  if (names.empty()) return;
  const ReportedEntries entries = reported_entries(end);
  for (std::size_t e = 0; e < estimate.parameters.size(); ++e) {
    EstimatedParameter& p = estimate.parameters[e];
    const Parameter& of = end[entries.parameter[e]];
    const bool covariance = of.domain == Domain::positive_definite && !entries.variance[e];
    if (!p.fixed && !covariance) p.prior = in_words(of.prior, p.unit);
  }
  if (!estimate.covariance_kind.empty()) estimate.covariance_kind += ", priors included";
  estimate.notes.push_back(
      fmt::format("maximum a posteriori: the prior of {} counts; log-likelihood, AIC and BIC are "
                  "those of the data alone",
                  fmt::join(names, ", ")));
}

std::string evaluation_method(EvaluationMethod method) {
  switch (method) {
    case EvaluationMethod::autocovariances:
      return "sample_autocovariances";
    case EvaluationMethod::steady_state:
      return "steady_state_filter";
    case EvaluationMethod::time_varying:
    case EvaluationMethod::automatic:
      break;
  }
  return "time_varying_filter";
}

// How the likelihood at the maximum was evaluated.
void report_evaluation(const EvaluationTaken& taken, Objective& objective) {
  objective.evaluation_method = evaluation_method(taken.method);
  if (taken.fallback == FallbackReason::none || taken.fallback == FallbackReason::not_requested)
    return;
  objective.evaluation_reason = describe(taken.fallback);
  if (taken.fallback == FallbackReason::long_memory) {
    objective.evaluation_reason += fmt::format(" (its pole is {:.6f})", taken.pole);
  }
}

// What a person should know about it.
Findings check_evaluation(const EvaluationTaken& taken, EvaluationMethod asked,
                          const Objective& objective) {
  const bool expected =
      taken.fallback == FallbackReason::short_segment && asked != EvaluationMethod::autocovariances;
  if (objective.evaluation_reason.empty() || expected ||
      taken.method == EvaluationMethod::autocovariances) {
    return {};
  }
  return {make_finding(
      FindingCode::evaluation_method, {},
      fmt::format("the likelihood was evaluated by the {} filter, the same value only slower: {}",
                  taken.method == EvaluationMethod::steady_state ? "steady-state" : "time-varying",
                  objective.evaluation_reason))};
}

}  // namespace

namespace {

// Where the search ended, and what lies there.
struct Maximum {
  ParameterSet end;
  SeveralStarts found;
};

// Is all that is not determined without any influence where the search has ended?
bool nothing_but_unexcited(const Estimate& estimate) {
  return std::none_of(
      estimate.parameters.begin(), estimate.parameters.end(),
      [](const EstimatedParameter& p) { return p.verdict == Verdict::not_identifiable; });
}

// Goes on from the best with other multipliers until the constraints hold.
void keep_constraints(SeveralStarts& found, RecordingsLikelihood& likelihood,
                      const FactorCoordinates& factors, const NoiseMlOptions& options) {
  const ParameterSet& parameters = likelihood.model().parameters;
  const auto holds = [&] {
    return !likelihood.tighten_constraints(with_coordinates(parameters, factors.to(found.best.x)));
  };
  for (int i = 0; found.best.summary.usable() && !holds(); ++i) {
    if (i == kMostTightenings) {
      found.best.summary.termination = Termination::no_progress;
      found.best.summary.message = "the constraints do not hold where the search has ended";
      return;
    }
    search_again(found, likelihood, factors, options);
  }
}

// The size of the noise by n - p degrees of freedom, as least squares are reported: the likeliest
// one divides by n.
void report_residual_deviations(NoiseEstimate& estimate, const Model& model,
                                const std::vector<Channel>& outputs, const ParameterSet& end,
                                double share) {
  const bool by_state = is_formula_model(model) && as_formulas(model).noise_scales.has_value();
  if (by_state) return;
  const Eigen::MatrixXd R = instantiate(noise_model(model), end).R;
  for (std::size_t j = 0; j < outputs.size(); ++j) {
    const auto i = static_cast<Index>(j);
    if (outputs[j].is_pseudo || !(R(i, i) > 0.0)) continue;
    const bool plain = outputs[j].transform == Transform::none;
    estimate.derived.push_back(
        {fmt::format("residual standard deviation of {}", outputs[j].name),
         plain ? outputs[j].unit : "",
         std::sqrt(R(i, i) * share) / (plain ? unit_scale(outputs[j].unit) : 1.0), kNone});
  }
}

// Searches, and reports all that likelihood and search say: parameters with their errors, profiles,
// bounds, the search itself.
Maximum take_maximum(NoiseEstimate& estimate, RecordingsLikelihood& likelihood,
                     const NoiseMlOptions& options) {
  const Model& model = likelihood.model();
  const ParameterSet& parameters = model.parameters;
  const LikelihoodProblem problem = likelihood.problem();
  const FactorCoordinates factors(parameters, named_covariances(model));
  likelihood.tighten_constraints(parameters);
  const double beside_start = likelihood.log_density_beside_data(parameters);
  const auto search = [&] { return search_from_starts(likelihood, parameters, factors, options); };
  SeveralStarts found = search();
  if (std::isnan(found.best.summary.objective)) {
    const FilterStatus start = likelihood.status_at_start();
    if (start != FilterStatus::ok) refuse_filter(model, likelihood.recordings(), start);
  }
  // The integration was as fine as the start needs it; all starts are compared on the same.
  for (int i = 0; i < kIntegrationRefinements && found.best.summary.usable() &&
                  likelihood.refine(with_coordinates(parameters, factors.to(found.best.x)));
       ++i) {
    if (found.shot) {
      search_again(found, likelihood, factors, options);
    } else {
      found = search();
    }
  }
  const VectorXd freedom_of_curves = learn_smoothness(found, likelihood, factors, options);
  keep_constraints(found, likelihood, factors, options);
  const VectorXd best = factors.to(found.best.x);
  ParameterSet end = with_coordinates(parameters, best);
  list_parameters(estimate, parameters, end);
  Objective& objective = estimate.objective;
  objective.log_likelihood_start =
      found.start_value - beside_start + likelihood.log_likelihood_of_beginning(parameters);
  objective.iterations = found.iterations;
  objective.evaluations = found.evaluations;
  objective.starts = static_cast<int>(found.ends.size());
  objective.starts_at_optimum = found.count(SearchEnd::best);
  const bool coloured = options.objective == FitObjective::simulation;
  const SimulationScore score =
      coloured ? simulation_score(model, likelihood.recordings(), end) : SimulationScore{};
  const auto samples = static_cast<Index>(likelihood.samples());
  const std::vector<Dataset>& recordings = likelihood.recordings();
  const bool by_residuals = options.errors == NoiseSize::residuals && !coloured;
  const double freedom = by_residuals ? residual_freedom(model, recordings, samples) : kNone;
  const JudgedMaximum judged = judge_maximum(estimate, likelihood, problem, end, best,
                                             found.on_circle, coloured ? &score : nullptr, freedom);
  report_priors(estimate, end);
  if (std::isfinite(freedom) && !recordings.empty()) {
    const double share = static_cast<double>(samples) / freedom;
    report_residual_deviations(estimate, model, recordings.front().outputs, end, share);
  }
  append(estimate.findings,
         check_constraints(model.constraints, likelihood.multipliers(), end, !coloured));
  if (!rows_have_no_order(model, end)) {
    report_evaluation(likelihood.evaluation_taken(), objective);
    append(estimate.findings,
           check_evaluation(likelihood.evaluation_taken(), options.evaluation, objective));
  }
  const bool converged = found.best.summary.usable();
  std::optional<Slopes> slopes;
  if (converged && !coloured) slopes = slopes_at(factors.problem(problem), found.best.x);
  const ProfiledMaximum maximum{likelihood, factors,         end,    found.best, judged, slopes,
                                samples,    options.threads, freedom};
  if (coloured) {
    append(estimate.findings, check_bounds(estimate, problem, best));
  } else if (converged && limit_variances_at_zero(estimate, maximum)) {
    append(estimate.findings, check_bounds(estimate, problem, best));
    append(estimate.findings, check_roots(estimate, found.on_circle));
  }
  // Others that are not determined would be searched for at every point of a profile.
  const bool determined = estimate.identifiability.rank == estimate.identifiability.of;
  // Profiles take the errors as white.
  const bool profiles = options.profiles && !coloured;
  if (profiles && converged && (determined || nothing_but_unexcited(estimate))) {
    append(estimate.findings, limit_from_below(estimate, maximum));
  }
  if (profiles && converged && determined) take_profile_intervals(estimate, maximum);
  if (options.pictures) estimate.pictures.searches = found.paths;
  if (options.pictures && !coloured && converged && determined) picture_profiles(estimate, maximum);
  if (!converged) withdraw_errors(estimate);
  report_curves(estimate, model, end, freedom_of_curves);
  append(estimate.findings, check_search(estimate, found.best.summary));
  if (converged && determined) {
    append(estimate.findings, check_equal_maxima(estimate, found, problem, parameters, factors));
  }
  return {std::move(end), std::move(found)};
}

// How the best was reached.
std::string way_to_simulation(const SeveralStarts& found) {
  if (found.by_path == 0) return "search on simulations alone";
  return fmt::format(
      "from prediction to simulation: multiple shooting, the states' freedom taken in {} stages, "
      "led "
      "{} of {} starts to the best",
      found.stages, found.by_path, found.ends.size());
}

void check_starts_asked(const NoiseMlOptions& options) {
  if (options.starts >= 0) return;
  throw std::invalid_argument(fmt::format("{} starts; expected at least 1", options.starts));
}

}  // namespace

NoiseEstimate tune_ml(const Model& given, const std::vector<Dataset>& recordings,
                      const NoiseMlOptions& options) {
  if (given.student) return tune_student(given, recordings, options);
  if (options.team != nullptr && options.team->works_for_another()) {
    Model model = checked(given, recordings);
    model.parameters = started_within_priors(model.parameters);
    work_for_team(model, recordings, options.evaluation, *options.team);
    return {};
  }
  if (has_population(given)) return fit_population(given, recordings, options);
  check_starts_asked(options);
  Model model = checked(given, recordings);
  model.parameters = started_within_priors(model.parameters);
  NoiseEstimate estimate;
  estimate.model_name = model.name;
  const bool simulation = options.objective == FitObjective::simulation;
  estimate.objective.method = simulation ? kSimulationMethod : "ml";
  check_recordings(model, recordings);
  RecordingsLikelihood likelihood(model, recordings, options.evaluation);
  const FilterStatus start = likelihood.status_at_start();
  // Other starts may lead to where equations of motion stay finite.
  const bool may_lead_on = start == FilterStatus::not_finite && is_formula_model(model);
  if (start != FilterStatus::ok && !may_lead_on) refuse_filter(model, recordings, start);
  if (options.team != nullptr) likelihood.share_with(*options.team);
  likelihood.condition_on_beginning();
  likelihood.weigh_by_priors();
  const auto [end, found] = take_maximum(estimate, likelihood, options);
  const std::vector<Dataset> started =
      simulation ? with_starts(model, end, recordings) : std::vector<Dataset>();
  report_noise_estimate(estimate, model, end, simulation ? started : recordings);
  if (simulation) estimate.notes.push_back(way_to_simulation(found));
  if (const std::string text = undefined_starts(found); !text.empty()) {
    estimate.notes.push_back(text);
  }
  if (found.best.summary.termination != Termination::stopped) {
    append(estimate.findings, check_starts(found));
    if (options.asks_references) {
      append(estimate.findings, check_against_references(model, end, recordings));
    }
  }
  conclude(estimate, "converged");
  return estimate;
}

NoiseEstimate tune_ml_digests(const Model& given, const std::vector<RecordingDigest>& digests,
                              const NoiseMlOptions& options) {
  check_starts_asked(options);
  check_takes_digests(given, digests.size());
  Model model = given;
  model.parameters = started_within_priors(model.parameters);
  NoiseEstimate estimate;
  estimate.model_name = model.name;
  estimate.objective.method = "ml";
  RecordingsLikelihood likelihood(model, digests);
  if (const FilterStatus start = likelihood.status_at_start(); start != FilterStatus::ok) {
    throw InputError({model.source, 0, 0},
                     fmt::format("at the values of the model file {}", describe(start)),
                     "a model for which the digest was made", "'identikal digest' makes another");
  }
  likelihood.weigh_by_priors();
  const auto [end, found] = take_maximum(estimate, likelihood, options);
  report_digest_estimate(estimate, model, end, likelihood);
  if (found.best.summary.termination != Termination::stopped) {
    append(estimate.findings, check_starts(found));
  }
  conclude(estimate, "converged");
  return estimate;
}

}  // namespace identikal
