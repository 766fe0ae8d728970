#include "identify/noise/population_fit.h"

#include <algorithm>
#include <cmath>
#include <map>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "identify/estimate/parameter_table.h"
#include "identify/filter/recordings_check.h"
#include "identify/filter/recordings_likelihood.h"
#include "identify/filter/report.h"
#include "identify/model/check.h"
#include "identify/model/own_parameters.h"
#include "identify/model/parameter_prior.h"
#include "identify/noise/estimate.h"
#include "identify/noise/internal/several_starts.h"
#include "identify/population/mixed_effects.h"
#include "lib/base/error.h"
#include "lib/base/random.h"
#include "lib/data/units.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kMostRefinements = 4;  // of the integration, each with a search of its own
constexpr int kDefaultStarts = 4;
constexpr double kLarge = 10000.0;  // samples: half as many starts
constexpr double kFalseDiscoveries = 0.05;
constexpr double kHalfWidth = 1.959963984540054;  // of a normal 95 % interval

// A parameter that varies, and those that are its values.
struct VaryingParameter {
  int mean = 0, spread = 0;
  std::vector<int> values;  // of each unit
};

struct Population {
  std::vector<VaryingParameter> parameters;
  std::vector<std::string> units;  // what the names of values end with
};

const Parameter& at(const Model& model, int parameter) {
  return model.parameters[static_cast<std::size_t>(parameter)];
}

[[noreturn]] void refuse(const Model& model, const std::string& what, const std::string& expected) {
  throw InputError({model.source, 0, 0}, what, expected);
}

Population population_of(const Model& model, const std::vector<Dataset>& recordings) {
  Population out;
  std::string label;
  for (const RecordingTable::Own& own : model.recordings.own) {
    if (own.spread < 0) continue;
    if (!out.parameters.empty() && own.label != label) {
      refuse(model, "spreads of values per recording and per label, or per two labels",
             "the same 'per' of all parameters with a spread");
    }
    label = own.label;
    out.parameters.push_back({own.parameter, own.spread, {}});
  }
  const std::string& first = at(model, out.parameters.front().mean).name;
  for (const Dataset& recording : recordings) {
    std::vector<int> values;
    for (const VaryingParameter& each : out.parameters) {
      const auto own = std::find_if(recording.own.begin(), recording.own.end(),
                                    [&](const auto& o) { return o.parameter == each.mean; });
      if (own == recording.own.end() || at(model, own->source).fixed ||
          at(model, own->source).scope != Scope::recording) {
        refuse(model,
               fmt::format("'{}' has a spread, and in {} the value of something else",
                           at(model, each.mean).name, recording.name),
               "values that are drawn from one population");
      }
      values.push_back(own->source);
    }
    const std::vector<int>& known = out.parameters.front().values;
    if (std::find(known.begin(), known.end(), values.front()) != known.end()) continue;
    for (std::size_t j = 0; j < values.size(); ++j) out.parameters[j].values.push_back(values[j]);
    out.units.push_back(at(model, values.front()).name.substr(first.size() + 1));
  }
  if (out.units.size() < 3) {
    refuse(model,
           fmt::format("a spread between {} {}", out.units.size(),
                       label.empty() ? "recordings" : "values of " + label),
           "three or more, better ten");
  }
  return out;
}

// The first coordinate of each free parameter; -1 of the others.
std::vector<Index> first_coordinates(const ParameterSet& parameters) {
  std::vector<Index> out(parameters.size(), -1);
  const std::vector<EntryDerivative> entries = entry_derivatives(parameters);
  for (std::size_t e = 0; e < entries.size(); ++e) {
    Index& first = out[static_cast<std::size_t>(entries[e].parameter)];
    if (first < 0) first = static_cast<Index>(e);
  }
  return out;
}

// Of each recording.
std::vector<Index> units_of(const Population& population, const RecordingsLikelihood& likelihood) {
  const VaryingParameter& first = population.parameters.front();
  std::vector<Index> out;
  for (const Dataset& recording : likelihood.recordings()) {
    const int value =
        sources_in(likelihood.model().parameters, recording)[static_cast<std::size_t>(first.mean)];
    out.push_back(std::find(first.values.begin(), first.values.end(), value) -
                  first.values.begin());
  }
  return out;
}

MixedEffectsProblem problem_of(const Population& population, RecordingsLikelihood& likelihood) {
  const ParameterSet& parameters = likelihood.model().parameters;
  MixedEffectsProblem out;
  out.data = likelihood.problem();
  out.correlated = likelihood.model().recordings.correlated;
  const std::vector<Index> first = first_coordinates(parameters);
  const auto q = static_cast<Index>(population.parameters.size());
  out.effects.resize(q, static_cast<Index>(population.units.size()));
  std::vector<bool> is_shared(static_cast<std::size_t>(out.data.lower.size()), true);
  for (Index j = 0; j < q; ++j) {
    const VaryingParameter& each = population.parameters[static_cast<std::size_t>(j)];
    out.logarithmic.push_back(varies_by_logarithm(at(likelihood.model(), each.mean)));
    for (std::size_t i = 0; i < each.values.size(); ++i) {
      const Index place = first[static_cast<std::size_t>(each.values[i])];
      out.effects(j, static_cast<Index>(i)) = place;
      is_shared[static_cast<std::size_t>(place)] = false;
    }
  }
  const std::vector<Index> owner = owners_of_entries(likelihood.model(), likelihood.recordings(),
                                                     units_of(population, likelihood));
  for (std::size_t e = 0; e < is_shared.size(); ++e) {
    if (!is_shared[e]) continue;
    out.shared.push_back(static_cast<Index>(e));
    out.unit_of_shared.push_back(owner[e]);
  }
  return out;
}

MixedEffectsStart start_of(const Population& population, const MixedEffectsProblem& problem,
                           const ParameterSet& parameters) {
  MixedEffectsStart out;
  out.shared = coordinates(parameters)(problem.shared);
  const auto q = static_cast<Index>(population.parameters.size());
  out.mean.resize(q);
  out.spread.resize(q);
  for (Index j = 0; j < q; ++j) {
    const VaryingParameter& each = population.parameters[static_cast<std::size_t>(j)];
    const double mean = parameters[static_cast<std::size_t>(each.mean)].scalar();
    out.mean[j] = problem.logarithmic[static_cast<std::size_t>(j)] ? std::log(mean) : mean;
    out.spread[j] = parameters[static_cast<std::size_t>(each.spread)].scalar();
  }
  return out;
}

// The numbers of a scale in which they are normal, as those of the parameter itself.
MarginalEstimate as_parameter(MarginalEstimate of, bool logarithmic) {
  if (!logarithmic) return of;
  return {std::exp(of.value), std::exp(of.value) * of.se, std::exp(of.low), std::exp(of.high)};
}

ParameterSet end_of(const Population& population, const MixedEffects& found,
                    const MixedEffectsProblem& problem, const ParameterSet& start) {
  ParameterSet out = with_coordinates(start, found.x);
  for (std::size_t j = 0; j < population.parameters.size(); ++j) {
    const VaryingParameter& each = population.parameters[j];
    const MarginalEstimate mean = as_parameter(found.mean[j], problem.logarithmic[j]);
    out[static_cast<std::size_t>(each.mean)].value.setConstant(mean.value);
    out[static_cast<std::size_t>(each.spread)].value.setConstant(found.spread[j].value);
  }
  return out;
}

void put(EstimatedParameter& row, const MarginalEstimate& of, double per_unit, double zero = 0.0) {
  row.fixed = false;
  const bool known = std::isfinite(of.se);
  row.se = known ? of.se / per_unit : kNone;
  row.ci95 = {(of.low - zero) / per_unit, (of.high - zero) / per_unit};
  row.verdict = !known                       ? Verdict::not_identifiable
                : relative_error(row) > 0.25 ? Verdict::poorly_determined
                                             : Verdict::ok;
}

// Shared ones, means and spreads with their errors, and each unit's values with what they are drawn by.
class Report {
 public:
  Report(NoiseEstimate& estimate, const Model& model, const Population& population,
         const MixedEffectsProblem& problem, const MixedEffects& found, const ParameterSet& end)
      : estimate_(estimate),
        model_(model),
        population_(population),
        problem_(problem),
        found_(found),
        end_(end) {}

  // Shared ones with their errors; the others are known so far.
  void shared() {
    list_parameters(estimate_, model_.parameters, end_);
    for (const VaryingParameter& each : population_.parameters) {
      for (const int value : each.values) row(value).fixed = true;
    }
    estimate_.covariance_kind = fmt::format("{} information of the marginal likelihood",
                                            found_.observed ? "observed" : "expected");
    estimate_.identifiability.of = estimate_.identifiability.rank =
        static_cast<int>(problem_.shared.size() + 2 * population_.parameters.size());
    // Errors by the entries of covariances, whose coordinates are those of their roots.
    const auto p = static_cast<Index>(problem_.shared.size());
    if (found_.covariance.size() == 0 || p == 0) return;
    const MatrixXd J = entry_jacobian(end_, found_.x)(problem_.shared, problem_.shared);
    const MatrixXd V = J * found_.covariance.topLeftCorner(p, p) * J.transpose();
    const VectorXd lower = problem_.data.lower(problem_.shared),
                   upper = problem_.data.upper(problem_.shared), x = found_.x(problem_.shared);
    Index k = -1;
    for (EstimatedParameter& each : estimate_.parameters) {
      if (each.fixed) continue;
      ++k;
      const double se = std::sqrt(std::max(0.0, V(k, k))) / unit_scale(each.unit);
      if (x[k] <= lower[k] || x[k] >= upper[k]) {
        each.verdict = Verdict::at_bound;
        estimate_.findings.push_back(make_finding(FindingCode::at_bound, {each.name},
                                                  fmt::format("{} ended at its bound", each.name)));
        continue;
      }
      const double half = kHalfWidth * se;
      put(each, {each.value, se > 0.0 ? se : kNone, each.value - half, each.value + half}, 1.0);
      names_.push_back(each.name);
      places_.push_back(k);
    }
  }

  // Means, spreads and the units' values.
  void varying() {
    for (std::size_t j = 0; j < population_.parameters.size(); ++j) put_effect(j);
    correlations();
    notes();
  }

 private:
  void notes() const {
    estimate_.notes.push_back(fmt::format(
        "the log-likelihood is that of the population: values of the {} {} are integrated out "
        "(Laplace)",
        population_.units.size(),
        model_.recordings.own.front().label.empty() ? "recordings" : "units"));
    name_strangers();
    for (std::size_t j = 0; j < population_.parameters.size(); ++j) {
      if (!found_.spread_at_zero[j]) continue;
      const std::string& name = at(model_, population_.parameters[j].mean).name;
      estimate_.findings.push_back(make_finding(
          FindingCode::at_bound, {at(model_, population_.parameters[j].spread).name},
          fmt::format("{} is not told to differ between recordings: its spread is at most {:.3g} "
                      "(95 %)",
                      name, found_.spread[j].high),
          fmt::format("without 'per' and 'spread' it is one number for all")));
    }
  }

  EstimatedParameter& row(int parameter) {
    const std::string& name = at(model_, parameter).name;
    return *std::find_if(estimate_.parameters.begin(), estimate_.parameters.end(),
                         [&](const EstimatedParameter& p) { return p.name == name; });
  }

  void put_effect(std::size_t j) {
    const VaryingParameter& of = population_.parameters[j];
    const auto effect = static_cast<Index>(j);
    const bool logarithmic = problem_.logarithmic[j];
    const Unit unit = unit_or_dimensionless(at(model_, of.mean).unit);
    EstimatedParameter& mean = row(of.mean);
    put(mean, as_parameter(found_.mean[j], logarithmic), unit.scale, unit.offset);
    EstimatedParameter& sd = row(of.spread);
    put(sd, found_.spread[j], unit_scale(sd.unit));
    if (found_.spread_at_zero[j]) sd.verdict = Verdict::at_bound;
    const auto p = static_cast<Index>(problem_.shared.size());
    const auto q = static_cast<Index>(population_.parameters.size());
    if (std::isfinite(mean.se)) names_.push_back(mean.name), places_.push_back(p + effect);
    if (std::isfinite(sd.se)) names_.push_back(sd.name), places_.push_back(p + q + effect);
    for (std::size_t i = 0; i < of.values.size(); ++i) {
      const auto u = static_cast<Index>(i);
      const double b = found_.effects(effect, u), se = found_.effects_se(effect, u);
      const double half = kHalfWidth * se;
      EstimatedParameter& value = row(of.values[i]);
      put(value, as_parameter({b, se, b - half, b + half}, logarithmic), unit.scale, unit.offset);
    }
  }

  void correlations() {
    if (found_.covariance.size() == 0) return;
    const MatrixXd V = found_.covariance(places_, places_);
    const VectorXd se = V.diagonal().cwiseSqrt();
    take_correlations();
    estimate_.correlation_names = names_;
    estimate_.correlation = se.cwiseInverse().asDiagonal() * V * se.cwiseInverse().asDiagonal();
  }

  // Between the values of one recording.
  void take_correlations() {
    std::size_t k = 0;
    for (std::size_t j = 0; j < population_.parameters.size() && problem_.correlated; ++j) {
      for (std::size_t i = j + 1; i < population_.parameters.size(); ++i) {
        const MarginalEstimate& r = found_.correlation[k++];
        estimate_.derived.push_back({fmt::format("correlation between {} and {}",
                                                 at(model_, population_.parameters[j].mean).name,
                                                 at(model_, population_.parameters[i].mean).name),
                                     "", r.value, r.se});
      }
    }
  }

  // Benjamini and Hochberg's procedure.
  void name_strangers() const {
    std::vector<Index> order(static_cast<std::size_t>(found_.p_value.size()));
    for (std::size_t i = 0; i < order.size(); ++i) order[i] = static_cast<Index>(i);
    std::sort(order.begin(), order.end(),
              [&](Index a, Index b) { return found_.p_value[a] < found_.p_value[b]; });
    std::size_t named = 0;
    for (std::size_t k = 0; k < order.size(); ++k) {
      const double share = static_cast<double>(k + 1) / static_cast<double>(order.size());
      if (found_.p_value[order[k]] <= kFalseDiscoveries * share) named = k + 1;
    }
    for (std::size_t k = 0; k < named; ++k) {
      estimate_.notes.push_back(fmt::format(
          "{} does not belong to the population of the others (p = {:.2g})",
          population_.units[static_cast<std::size_t>(order[k])], found_.p_value[order[k]]));
    }
  }

  NoiseEstimate& estimate_;
  const Model& model_;
  const Population& population_;
  const MixedEffectsProblem& problem_;
  const MixedEffects& found_;
  const ParameterSet& end_;
  std::vector<std::string> names_;
  std::vector<Index> places_;  // in the covariance
};

// The model in which the units' values are known.
Model with_known_units(Model model, const Population& population) {
  for (const VaryingParameter& each : population.parameters) {
    for (const int value : each.values) {
      model.parameters[static_cast<std::size_t>(value)].fixed = true;
    }
  }
  return model;
}

ParameterSet with_values_of(ParameterSet parameters, const ParameterSet& values) {
  for (std::size_t i = 0; i < parameters.size(); ++i) parameters[i].value = values[i].value;
  return parameters;
}

// Another place to begin at: what cannot be negative by factors, other numbers by halves of themselves.
MixedEffectsStart scattered(MixedEffectsStart from, const MixedEffectsProblem& problem,
                            Random& random) {
  const VectorXd lower = problem.data.lower(problem.shared),
                 upper = problem.data.upper(problem.shared);
  for (Index k = 0; k < from.shared.size(); ++k) {
    double& x = from.shared[k];
    x = lower[k] >= 0.0 ? x * std::exp(random.normal()) : x * (1.0 + 0.5 * random.normal());
    x = std::clamp(x, lower[k], upper[k]);
  }
  for (Index j = 0; j < from.mean.size(); ++j) {
    const bool logarithmic = problem.logarithmic[static_cast<std::size_t>(j)];
    from.mean[j] += random.normal() * (logarithmic ? 1.0 : 0.5 * std::abs(from.mean[j]));
  }
  return from;
}

MixedEffectsStart start_at(const MixedEffects& found, const MixedEffectsProblem& problem,
                           MixedEffectsStart out) {
  constexpr double kLeast = 1e-3;  // of where the spread began: one of zero may be left again
  out.shared = found.x(problem.shared);
  for (Index j = 0; j < out.mean.size(); ++j) {
    const auto effect = static_cast<std::size_t>(j);
    out.mean[j] = found.mean[effect].value;
    out.spread[j] = std::max(found.spread[effect].value, kLeast * out.spread[j]);
  }
  return out;
}

struct Searched {
  MixedEffects best;
  SeveralStarts all;
};

// From the values given, and from scattered ones; the best once more, with its errors.
Searched search(const Population& population, RecordingsLikelihood& likelihood,
                const ParameterSet& from, int starts, const NoiseMlOptions& options) {
  constexpr double kSame = 1e-3;  // nats
  SolverOptions solver;
  if (options.iterations > 0) solver.max_iterations = options.iterations;
  solver.decrement_tolerance = 1e-7;
  const MixedEffectsProblem problem = problem_of(population, likelihood);
  const MixedEffectsStart first = start_of(population, problem, from);
  Random random(options.seed);
  Searched out;
  std::vector<bool> usable;
  for (int s = 0; s < starts; ++s) {
    if (options.progress) {
      solver.progress = [&](int iteration, double L) {
        return options.progress(s + 1, iteration, L);
      };
    }
    MixedEffects one = maximise_marginal(
        problem, s == 0 ? first : scattered(first, problem, random), solver, starts == 1);
    out.all.evaluations += one.summary.evaluations;
    out.all.iterations += one.summary.iterations;
    if (s == 0) out.all.start_value = one.summary.initial_objective;
    if (one.x.size() == 0) {
      ++out.all.undefined;
      continue;
    }
    const double L = one.summary.objective;
    out.all.log_likelihood.push_back(L);
    usable.push_back(one.summary.usable());
    const bool better =
        out.best.x.size() == 0 || L > out.best.summary.objective + kSame ||
        (usable.back() && !out.best.summary.usable() && L > out.best.summary.objective - kSame);
    if (better) out.best = std::move(one);
    if (out.best.summary.termination == Termination::stopped) break;
  }
  if (starts > 1 && out.best.summary.usable()) {
    out.best = maximise_marginal(problem, start_at(out.best, problem, first), solver);
    out.all.evaluations += out.best.summary.evaluations;
  }
  out.all.best.summary = out.best.summary;
  for (std::size_t s = 0; s < usable.size(); ++s) {
    const bool same = out.all.log_likelihood[s] > out.best.summary.objective - kSame;
    out.all.ends.push_back(same        ? SearchEnd::best
                           : usable[s] ? SearchEnd::maximum
                                       : SearchEnd::short_of);
  }
  return out;
}

}  // namespace

NoiseEstimate fit_population(const Model& given, const std::vector<Dataset>& recordings,
                             const NoiseMlOptions& options) {
  refuse_constraints(given, "a population");
  if (options.objective != FitObjective::one_step) {
    refuse(given, "a spread with --objective simulation", "errors one sample ahead");
  }
  Model model = checked(given, recordings);
  model.parameters = started_within_priors(model.parameters);
  check_recordings(model, recordings);
  const Population population = population_of(model, recordings);
  RecordingsLikelihood likelihood(model, recordings, options.evaluation);
  const FilterStatus start = likelihood.status_at_start();
  if (start != FilterStatus::ok) refuse_filter(model, recordings, start);
  if (options.team != nullptr) likelihood.share_with(*options.team);
  likelihood.condition_on_beginning();
  likelihood.weigh_by_priors();

  NoiseEstimate estimate;
  estimate.model_name = model.name;
  estimate.objective.method = "ml";
  Objective& objective = estimate.objective;
  const bool is_large = likelihood.samples() > kLarge;
  const int starts = options.starts > 0 ? options.starts : is_large ? 2 : kDefaultStarts;
  auto [found, all] = search(population, likelihood, model.parameters, starts, options);
  const MixedEffectsProblem problem = problem_of(population, likelihood);
  if (found.x.size() == 0) refuse_filter(model, recordings, FilterStatus::indefinite);
  objective.log_likelihood_start = all.start_value;
  objective.evaluations = all.evaluations;
  objective.iterations = all.iterations;
  objective.starts = static_cast<int>(all.ends.size());
  objective.starts_at_optimum = all.count(SearchEnd::best);
  ParameterSet end = end_of(population, found, problem, model.parameters);
  for (int i = 0; i < kMostRefinements && found.summary.usable() && likelihood.refine(end); ++i) {
    Searched finer = search(population, likelihood, end, 1, options);
    found = std::move(finer.best);
    objective.evaluations += finer.all.evaluations;
    end = end_of(population, found, problem, model.parameters);
  }
  Report report(estimate, model, population, problem, found, end);
  report.shared();
  // To the tests of innovations each recording's own values are numbers like others.
  const Model given_units = with_known_units(model, population);
  report_noise_estimate(estimate, given_units, with_values_of(given_units.parameters, end),
                        recordings);
  report.varying();
  if (!found.summary.usable()) withdraw_errors(estimate);
  append(estimate.findings, check_search(estimate, found.summary));
  if (found.summary.termination != Termination::stopped) {
    append(estimate.findings, check_starts(all));
  }
  objective.log_likelihood = found.summary.objective;
  const std::size_t q = population.parameters.size();
  const std::size_t of_spread = problem.correlated ? q * (q + 1) / 2 : q;
  const auto k = static_cast<double>(problem.shared.size() + q + of_spread);
  const double twice = 2.0 * objective.log_likelihood;
  objective.aic = 2.0 * k - twice;
  objective.bic = k * std::log(static_cast<double>(objective.rows)) - twice;
  objective.bic_values = k * std::log(static_cast<double>(objective.samples)) - twice;
  objective.leading.resize(0);
  objective.diffuse_samples = 0;
  conclude(estimate, "converged");
  return estimate;
}

}  // namespace identikal
