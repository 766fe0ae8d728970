#include "identify/noise/ml.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <stdexcept>

#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "identify/estimate/distribution.h"
#include "identify/estimate/parameter_table.h"
#include "identify/filter/recordings_check.h"
#include "identify/filter/recordings_likelihood.h"
#include "identify/filter/report.h"
#include "identify/model/check.h"
#include "identify/model/parameter_prior.h"
#include "identify/noise/estimate.h"
#include "identify/noise/internal/scattered_start.h"
#include "identify/noise/likelihood_profile.h"
#include "identify/noise/reference_tuning.h"
#include "lib/base/random.h"
#include "lib/data/units.h"
#include "lib/filter/likelihood.h"
#include "solvers/covariance.h"
#include "solvers/scoring.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kRefinements = 4;        // of the integration, each with a search of its own
constexpr double kSameMaximum = 1e-4;  // log-likelihoods closer than this are the same maximum

// A search has ended at a maximum where it converged and every coordinate matters: where a variance
// is zero, what it drives may lie anywhere, and the likelihood rises elsewhere on that
// plateau.
bool is_maximum(const LikelihoodProblem& problem, const Solution& end) {
  constexpr double kNothing = 1e-9;  // information on a coordinate in units of itself
  double L = 0.0;
  VectorXd gradient;
  MatrixXd information;
  if (!end.summary.usable() || !problem.evaluate(end.x, L, &gradient, &information)) return false;
  const VectorXd size = end.x.cwiseAbs().cwiseMax(1e-300);
  const VectorXd weight = information.diagonal().array() * size.array().square();
  for (Index i = 0; i < end.x.size(); ++i) {
    if (end.x[i] != 0.0 && !(weight[i] > kNothing)) return false;
  }
  return true;
}

struct Search {
  Solution best;
  double start_value = kNone;
  int iterations = 0, evaluations = 0, tried = 0, agree = 0;
  std::vector<double> other_maxima;  // log-likelihoods of ends that are maxima, below the best
  std::vector<double> stopped;       // of ends that are none
  std::vector<std::vector<double>> paths;  // log-likelihood by iteration
};

Search search(const LikelihoodProblem& problem, const ParameterSet& parameters,
              const NoiseMlOptions& options) {
  Search out;
  Random random(options.seed);
  std::vector<Solution> ends;
  bool stopped = false;
  for (int s = 0; s < options.starts && !stopped; ++s) {
    VectorXd start =
        s == 0 ? coordinates(parameters) : coordinates(scattered_start(parameters, random));
    start = start.cwiseMax(problem.lower).cwiseMin(problem.upper);
    SolverOptions solver;
    solver.decrement_tolerance = 1e-15;
    std::vector<double> path;
    solver.progress = [&](int iteration, double L) {
      path.push_back(L);
      stopped = options.progress && !options.progress(s + 1, iteration, L);
      return !stopped;
    };
    const Solution solution = maximise(problem, start, solver);
    path.insert(path.begin(), solution.summary.initial_objective);
    if (s == 0) out.start_value = solution.summary.initial_objective;
    ++out.tried;
    out.iterations += solution.summary.iterations;
    out.evaluations += solution.summary.evaluations;
    // A scattered start where the likelihood is undefined says nothing of other maxima.
    if (s > 0 && solution.summary.termination == Termination::start_undefined) {
      --out.tried;
      continue;
    }
    ends.push_back(solution);
    out.paths.push_back(std::move(path));
    // A converged end beats an unconverged one unless that one is really higher.
    const double lead = solution.summary.objective - out.best.summary.objective;
    const bool first = std::isnan(out.best.summary.objective);
    if (first || lead > kSameMaximum ||
        (lead > -kSameMaximum && solution.summary.usable() &&
         (!out.best.summary.usable() || lead > 0.0))) {
      if (!std::isnan(solution.summary.objective) || first) out.best = solution;
    }
  }
  // Whatever an earlier start found, the search was not finished.
  if (stopped) {
    out.best.summary.termination = Termination::stopped;
    out.best.summary.message = "stopped by the caller";
  }
  for (const Solution& end : ends) {
    const double L = end.summary.objective;
    if (std::abs(L - out.best.summary.objective) < kSameMaximum) {
      ++out.agree;
    } else {
      (is_maximum(problem, end) ? out.other_maxima : out.stopped).push_back(L);
    }
  }
  return out;
}

// Where the starts ended, if not all at the best. Where a search stopped short says nothing of other
// maxima, however often it does.
Findings check_starts(const Search& found) {
  if (found.other_maxima.empty() && found.stopped.empty()) return {};
  const auto below = [&](const std::vector<double>& ends) {
    return found.best.summary.objective - *std::max_element(ends.begin(), ends.end());
  };
  std::string text =
      fmt::format("{} of {} starts reached the same optimum", found.agree, found.tried);
  if (!found.other_maxima.empty()) {
    text += fmt::format("; {} ended at other maxima, the highest {:.3g} below",
                        found.other_maxima.size(), below(found.other_maxima));
  }
  if (!found.stopped.empty()) {
    text += fmt::format(
        "; {} stopped where the likelihood is flat or short of a maximum, the "
        "highest {:.3g} below",
        found.stopped.size(), below(found.stopped));
  }
  const bool several = !found.other_maxima.empty();
  return {{FindingCode::several_maxima,
           several ? Severity::warning : Severity::note,
           {},
           text,
           several ? "raise --starts until more of them reach the best" : ""}};
}

// Largest value of coordinate i whose profile likelihood lies within the one-sided 95 % limit.
std::optional<double> profile_upper_limit(const LikelihoodProblem& problem, const VectorXd& optimum,
                                          double maximum, Index i, double guess) {
  const double drop = 0.5 * chi_square_quantile(0.9, 1.0);
  LikelihoodProblem held = problem;
  VectorXd x = optimum;
  const auto profile = [&](double value) {
    held.lower[i] = held.upper[i] = value;
    x[i] = value;
    const Solution solution = maximise(held, x);
    x = solution.x;
    return solution.summary.objective - maximum + drop;
  };
  const double bound = problem.upper[i];
  double low = optimum[i], high = std::min(std::max(guess, 1e-12), bound);
  for (int k = 0; profile(high) > 0.0; ++k) {
    if (high == bound) return bound;
    low = high;
    high = std::min(2.0 * high, bound);
    if (k == 100) return std::nullopt;
  }
  while (high - low > 1e-4 * high) {
    const double middle = 0.5 * (low + high);
    (profile(middle) > 0.0 ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

// Which free entries have no two-sided error: those whose coordinate ended at its bound, and those
// of a covariance matrix that ended singular.
std::vector<bool> at_boundary(const ParameterSet& end, const LikelihoodProblem& problem,
                              const VectorXd& x) {
  constexpr double kSingular = 1e-9;
  std::vector<bool> out;
  Index at = 0;
  for (const Parameter& p : end) {
    if (p.fixed) continue;
    const Index own = free_entries({p}).size();
    bool singular = false;
    if (p.domain == Domain::positive_definite) {
      const VectorXd sd = p.value.diagonal().cwiseSqrt();
      const MatrixXd scaled =
          sd.cwiseInverse().asDiagonal() * p.value * sd.cwiseInverse().asDiagonal();
      singular = !scaled.allFinite() ||
                 Eigen::SelfAdjointEigenSolver<MatrixXd>(scaled, Eigen::EigenvaluesOnly)
                         .eigenvalues()
                         .minCoeff() < kSingular;
    }
    for (Index i = at; i < at + own; ++i) {
      out.push_back(singular || x[i] <= problem.lower[i] || x[i] >= problem.upper[i]);
    }
    at += own;
  }
  return out;
}

// Errors of everything that was estimated, from the information at the maximum.
void judge(Estimate& estimate, RecordingsLikelihood& likelihood, const LikelihoodProblem& problem,
           const ParameterSet& end, const Solution& best) {
  const Likelihood* result = likelihood.evaluate(end, true);
  if (result == nullptr) return;
  const MatrixXd all = result->information;
  const VectorXd z = free_entries(end);
  const InteriorParameters inside =
      interior_parameters(estimate, at_boundary(end, problem, best.x));
  const auto k = static_cast<Index>(inside.entries.size());
  if (k == 0) return;
  const VectorXd& unit = inside.unit;
  const auto in_units = [&unit](const MatrixXd& information) {
    return MatrixXd(unit.asDiagonal() * information * unit.asDiagonal());
  };
  const MatrixXd information = in_units(all(inside.entries, inside.entries));

  MatrixXd covariance;
  const std::optional<MatrixXd> bound = scaled_inverse(information, 1e-9);
  if (bound) {
    VectorXd inside_z(k), step(k);
    for (Index j = 0; j < k; ++j) {
      const Index at = inside.entries[j];
      inside_z[j] = z[at];
      // Small against the error, but never across a bound.
      step[j] = 1e-3 * std::sqrt((*bound)(j, j)) * unit[j];
      if (z[at] == best.x[at]) {
        step[j] = std::min(
            {step[j], 0.5 * (z[at] - problem.lower[at]), 0.5 * (problem.upper[at] - z[at])});
      }
    }
    const auto gradient_at = [&](const VectorXd& at, VectorXd& g) {
      VectorXd full = z;
      for (Index j = 0; j < k; ++j) full[inside.entries[j]] = at[j];
      const Likelihood* there = likelihood.evaluate(with_entries(end, full), true);
      if (there == nullptr) return false;
      g.resize(k);
      for (Index j = 0; j < k; ++j) g[j] = there->gradient[inside.entries[j]];
      return true;
    };
    const auto observed = observed_information(gradient_at, inside_z, step);
    const auto inverse_observed = observed ? scaled_inverse(in_units(*observed)) : std::nullopt;
    covariance = inverse_observed ? *inverse_observed : *bound;
    estimate.covariance_kind = inverse_observed ? "observed information"
                                                : "expected information (the observed one is not "
                                                  "positive definite)";
  } else {
    estimate.covariance_kind = "partial: some directions carry no information";
    // Entries outside the flat directions keep an error: the pseudo-inverse holds it.
    covariance = information.completeOrthogonalDecomposition().pseudoInverse();
  }
  judge_parameters(estimate, information, covariance);
  if (bound) {
    const MatrixXd products = likelihood.score_products(end);
    if (products.size() > 0) {
      const MatrixXd sandwich =
          covariance * in_units(products(inside.entries, inside.entries)) * covariance;
      for (Index j = 0; j < k; ++j) {
        EstimatedParameter& p = *inside.reported[j];
        if (!std::isnan(p.se)) p.se_sandwich = std::sqrt(sandwich(j, j));
      }
    }
  }
  for (Index j = 0; j < k && bound; ++j) {
    inside.reported[j]->crb_se = std::sqrt((*bound)(j, j));
  }
}

// Where the profile likelihood of coordinate i has fallen by half a chi-square quantile, on one
// side (sign) of the maximum: the coordinate, or its bound where it does not fall that far.
std::optional<double> profile_end(const LikelihoodProblem& problem, const Solution& best,
                                  double maximum, Index i, double se, double sign) {
  const double target = std::sqrt(chi_square_quantile(0.95, 1.0));
  LikelihoodProblem held = problem;
  VectorXd x = best.x;
  // Signed root of the drop, close to linear in the coordinate; nothing where it is undefined.
  const auto root = [&](double value) -> std::optional<double> {
    held.lower[i] = held.upper[i] = value;
    x[i] = value;
    const Solution solution = maximise(held, x);
    if (!solution.summary.usable()) return std::nullopt;
    x = solution.x;
    return std::sqrt(2.0 * std::max(0.0, maximum - solution.summary.objective));
  };
  const double bound = sign < 0.0 ? problem.lower[i] : problem.upper[i];
  double near = best.x[i], near_root = 0.0, far = near + sign * target * se;
  for (int k = 0; k < 60; ++k) {
    const bool stopped = sign * (far - bound) >= 0.0;
    if (stopped) far = bound;
    const auto far_root = root(far);
    if (!far_root) return std::nullopt;
    if (std::abs(*far_root - target) < 1e-5) return far;
    if (*far_root < target && stopped) return bound;
    if (*far_root < target) {  // not far enough yet
      const double slope = (*far_root - near_root) / (far - near);
      near = far;
      near_root = *far_root;
      const double step = slope * sign > 0.0 ? (target - near_root) / slope : sign * se;
      far = near + sign * std::clamp(std::abs(step), 1e-9 * se, 4.0 * se);
    } else {
      far = near + (far - near) * (target - near_root) / (*far_root - near_root);
    }
  }
  return std::nullopt;
}

// The maximum that profiles are taken about.
struct Maximum {
  const LikelihoodProblem& problem;
  const Solution& best;
  const ParameterSet& end;  // the parameters there
  EvaluationMethod method;  // of an evaluation
  Index samples;            // measured values

  bool profiles_are_cheap() const {
    constexpr Index kCheap = 20000;  // samples
    return method == EvaluationMethod::autocovariances || samples <= kCheap;
  }
};

// Calls visit(parameter, coordinate, its unit, largest log-likelihood) for every one that a
// profile can be taken of, where an evaluation is cheap. Coordinates of a full covariance matrix
// are not its entries, and get none.
template <typename Visit>
void for_each_profiled(Estimate& estimate, const Maximum& at, Visit&& visit) {
  if (!at.profiles_are_cheap()) return;
  double maximum = 0.0;
  if (!at.problem.evaluate(at.best.x, maximum, nullptr, nullptr)) return;
  const ReportedEntries entries = reported_entries(at.end);
  Index i = -1;
  for (std::size_t k = 0; k < estimate.parameters.size(); ++k) {
    EstimatedParameter& p = estimate.parameters[k];
    if (p.fixed) continue;
    ++i;
    const Domain domain = at.end[entries.parameter[k]].domain;
    if (domain == Domain::positive_definite || std::isnan(p.se)) continue;
    visit(p, i, unit_or_dimensionless(p.unit), maximum);
  }
}

void profile(Estimate& estimate, const Maximum& at) {
  const auto find_ends = [&at](EstimatedParameter& p, Index i, const Unit& unit, double maximum) {
    const auto low = profile_end(at.problem, at.best, maximum, i, p.se * unit.scale, -1.0);
    const auto high = profile_end(at.problem, at.best, maximum, i, p.se * unit.scale, 1.0);
    if (low && high) p.profile95 = {unit.from_si(*low), unit.from_si(*high)};
  };
  for_each_profiled(estimate, at, find_ends);
}

// The profile likelihood as a curve: from the maximum outwards until it has fallen well below the
// 95 % limit, or to the bound.
void picture_profiles(NoiseEstimate& estimate, const Maximum& at) {
  const auto walk = [&](EstimatedParameter& p, Index i, const Unit& unit, double maximum) {
    LikelihoodProblem held = at.problem;
    VectorXd x = at.best.x;
    const auto drop_at = [&](double value) -> std::optional<double> {
      held.lower[i] = held.upper[i] = value;
      x[i] = value;
      const Solution solution = maximise(held, x);
      if (!solution.summary.usable()) return std::nullopt;
      x = solution.x;
      return 2.0 * std::max(0.0, maximum - solution.summary.objective);
    };
    const auto drop_from_optimum = [&](double value, bool turned) {
      if (turned) x = at.best.x;
      return drop_at(value);
    };
    LikelihoodProfile profile = walk_profile(at.best.x[i], p.se * unit.scale, at.problem.lower[i],
                                             at.problem.upper[i], drop_from_optimum);
    profile.name = p.name;
    for (double& value : profile.value) value = unit.from_si(value);
    if (profile.value.size() > 2) estimate.pictures.profiles.push_back(std::move(profile));
  };
  for_each_profiled(estimate, at, walk);
}

// A variance that ended at zero: how large could it be? False: nothing is known there.
bool limit_boundary(Estimate& estimate, const LikelihoodProblem& problem, const Solution& best) {
  double L = 0.0;
  VectorXd gradient;
  MatrixXd information;
  if (!problem.evaluate(best.x, L, &gradient, &information)) return false;
  Index i = -1;
  for (EstimatedParameter& p : estimate.parameters) {
    if (p.fixed) continue;
    ++i;
    if (best.x[i] > problem.lower[i] || problem.lower[i] != 0.0) continue;
    const double guess =
        information(i, i) > 0.0 ? 0.1 / std::sqrt(information(i, i)) : best.x.cwiseAbs().maxCoeff();
    const auto limit = profile_upper_limit(problem, best.x, L, i, guess);
    p.ci95 = limit ? std::array<double, 2>{0.0, *limit / unit_scale(p.unit)}
                   : std::array<double, 2>{kNone, kNone};
  }
  return true;
}

// Parameters at their bounds. @param estimate  with the limits of limit_boundary()
Findings check_bounds(const Estimate& estimate, const LikelihoodProblem& problem,
                      const Solution& best) {
  Findings out;
  Index i = -1;
  for (const EstimatedParameter& p : estimate.parameters) {
    if (p.fixed) continue;
    ++i;
    const bool lower = best.x[i] <= problem.lower[i], upper = best.x[i] >= problem.upper[i];
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

NoiseEstimate tune_ml(const Model& given, const std::vector<Dataset>& recordings,
                      const NoiseMlOptions& options) {
  if (options.starts < 1) {
    throw std::invalid_argument(fmt::format("{} starts; expected at least 1", options.starts));
  }
  Model model = checked(given, recordings);
  model.parameters = started_within_priors(model.parameters);
  const ParameterSet& parameters = model.parameters;
  NoiseEstimate estimate;
  estimate.model_name = model.name;
  estimate.objective.method = "ml";
  check_recordings(model, recordings);

  RecordingsLikelihood likelihood(model, recordings, options.evaluation);
  if (const FilterStatus start = likelihood.status_at_start(); start != FilterStatus::ok) {
    refuse_filter(model, recordings, start);
  }
  likelihood.condition_on_beginning();
  likelihood.weigh_by_priors();
  const LikelihoodProblem problem = likelihood.problem();
  Search found = search(problem, parameters, options);
  // The integration was as fine as the start needs it; all starts are compared on the same.
  for (int i = 0; i < kRefinements && found.best.summary.usable() &&
                  likelihood.refine(with_coordinates(parameters, found.best.x));
       ++i) {
    found = search(problem, parameters, options);
  }
  const ParameterSet end = with_coordinates(parameters, found.best.x);
  list_parameters(estimate, parameters, end);
  Objective& objective = estimate.objective;
  objective.log_likelihood_start = found.start_value - stated_priors_at(parameters).value +
                                   likelihood.log_likelihood_of_beginning(parameters);
  objective.iterations = found.iterations;
  objective.evaluations = found.evaluations;
  objective.starts = found.tried;
  objective.starts_at_optimum = found.agree;
  judge(estimate, likelihood, problem, end, found.best);
  report_priors(estimate, end);
  report_evaluation(likelihood.evaluation_taken(), objective);
  append(estimate.findings,
         check_evaluation(likelihood.evaluation_taken(), options.evaluation, objective));
  if (limit_boundary(estimate, problem, found.best)) {
    append(estimate.findings, check_bounds(estimate, problem, found.best));
  }
  const bool converged = found.best.summary.usable();
  const Maximum maximum{problem, found.best, end, likelihood.evaluation_taken().method,
                        samples_present(recordings)};
  if (options.profiles && converged) profile(estimate, maximum);
  if (options.pictures) estimate.pictures.searches = found.paths;
  if (options.pictures && converged) picture_profiles(estimate, maximum);
  if (!converged) withdraw_errors(estimate);
  append(estimate.findings, check_search(estimate, found.best.summary));
  report_noise_estimate(estimate, model, end, recordings);
  if (found.best.summary.termination != Termination::stopped) {
    append(estimate.findings, check_starts(found));
    append(estimate.findings, check_against_references(model, end, recordings));
  }
  conclude(estimate, "converged");
  return estimate;
}

}  // namespace identikal
