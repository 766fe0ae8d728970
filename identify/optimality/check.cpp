#include "identify/optimality/check.h"

#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "identify/estimate/parameter_table.h"
#include "identify/filter/digest_file.h"
#include "identify/filter/outliers.h"
#include "identify/filter/recordings_check.h"
#include "identify/filter/recordings_likelihood.h"
#include "identify/filter/report.h"
#include "identify/filter/student_weights.h"
#include "identify/model/check.h"
#include "identify/optimality/breaks.h"
#include "identify/optimality/distance.h"
#include "identify/optimality/optimality.h"
#include "identify/optimality/score_statistic.h"
#include "lib/data/units.h"

namespace identikal {

using Eigen::Index;

namespace {

// Below this no test has its stated error.
constexpr Index kFewestInnovations = 20;

std::string values_of(const ParameterSet& parameters) {
  const ReportedEntries to = reported_entries(parameters);
  std::string out;
  for (std::size_t i = 0; i < to.names.size(); ++i) {
    if (parameters[to.parameter[i]].fixed) continue;
    const Unit unit = unit_or_dimensionless(to.units[i]);
    out += fmt::format("{}{} = {:.4g}", out.empty() ? "" : ", ", to.names[i],
                       unit.from_si(to.value[i]));
  }
  return out;
}

// A step to likelier noise, in words.
void report_better(const Retuned& better, const std::vector<NoiseGain>& changes,
                   OptimalityReport& estimate) {
  estimate.notes.push_back(fmt::format(
      "a few scoring steps gain {:.4g} in log-likelihood and lead to {}; 'tune' estimates them",
      better.gain, values_of(better.parameters)));
  if (changes.empty()) return;
  estimate.notes.push_back("in order of gain, one after the other: " + in_order(changes));
}

void say_distance(const Retuned& better, const std::vector<NoiseGain>& changes, Optimality& found) {
  if (found.faults.empty() || better.gain <= 0.0 || changes.empty()) return;
  std::string& first = found.faults.front();
  if (!first.starts_with("the noise covariances are wrong")) return;
  first += fmt::format("; together {:.4g} nats from the likeliest", better.gain);
}

void report_verdict(const Optimality& found, OptimalityReport& estimate) {
  if (found.optimal) return;
  const std::string faults = fmt::format("{}", fmt::join(found.faults, "; "));
  estimate.findings.push_back(make_finding(FindingCode::test_rejects, {},
                                           "not optimal" + (faults.empty() ? "" : ": " + faults)));
}

// What staying at the present noise costs, of states and of likelihood, and which changes end that.
void report_distance(OptimalityReport& estimate, const Model& model,
                     const std::vector<Dataset>& recordings, Optimality& found) {
  const Model freed = with_free_noise(model);
  const Retuned better = retuned(freed, recordings);
  const bool known = !std::isnan(better.gain);
  StateExcess excess;
  if (known) excess = state_excess(freed, better.parameters, recordings);
  if (is_formula_model(model)) {
    if (known && std::isfinite(excess.of_all)) {
      estimate.derived.push_back({"excess mean-square error", "%", 100.0 * excess.of_all, kNone});
    }
    if (!changes(model)) {
      estimate.notes.emplace_back("tests of a nonlinear filter take its innovations for Gaussian");
    }
  } else {
    estimate.derived.push_back({"excess mean-square error", "%", 100.0 * better.loss, kNone});
  }
  if (found.optimal || !known) return;
  const std::vector<NoiseGain> changes = changes_in_order(freed, better.parameters, recordings);
  report_better(better, changes, estimate);
  if (const std::string states = in_words(excess, model); !states.empty()) {
    estimate.notes.push_back("mean-square errors of states above those with that noise: " + states);
  }
  say_distance(better, changes, found);
}

}  // namespace

OptimalityReport check(const Model& given, const std::vector<Dataset>& recordings) {
  const Model model = checked(given, recordings);
  if (!has_filter(model)) {
    throw InputError({model.source, 0, 0},
                     "'check' tests a Kalman filter, this model is a vehicle without noise",
                     "a model with Q and R", "'fit' tests the residuals itself");
  }
  OptimalityReport estimate;
  estimate.model_name = model.name;
  estimate.objective.method = "check";
  list_known_parameters(estimate, model.parameters);
  check_channels(recordings);
  const std::vector<FilterResult> filters =
      report_filter(estimate, model, model.parameters, recordings);
  Index innovations = 0;
  for (const FilterResult& filter : filters) {
    innovations += (filter.standardised.array() == filter.standardised.array()).count();
  }
  if (innovations < kFewestInnovations) {
    throw InputError(
        {recordings[0].name, 0, 0}, fmt::format("{} innovations are too few to test", innovations),
        fmt::format("at least {} measured samples behind a diffuse start", kFewestInnovations),
        "use a longer recording");
  }
  Optimality found = test_optimality(model, recordings, filters);
  estimate.tests = std::move(found.tests);
  estimate.notes.insert(estimate.notes.end(), found.notes.begin(), found.notes.end());
  if (model.student) {
    estimate.notes.push_back(student_note(model));
  } else {
    report_distance(estimate, model, recordings, found);
  }
  if (!model.student) {
    append(estimate.findings,
           check_outliers_and_offset(model, model.parameters, recordings, filters));
  }
  append(estimate.findings, found.findings);
  for (const Break& jump : model.student ? std::vector<Break>{} : find_breaks(model, recordings)) {
    estimate.notes.push_back(sentence(jump, model, recordings));
  }
  report_verdict(found, estimate);
  conclude(estimate, "no test rejects optimality", Basis::tests);
  return estimate;
}

OptimalityReport check(const Model& model, const std::vector<RecordingDigest>& digests) {
  check_takes_digests(model, digests.size());
  OptimalityReport estimate;
  estimate.model_name = model.name;
  estimate.objective.method = "check";
  list_known_parameters(estimate, model.parameters);
  static_cast<FilterMatrices&>(estimate) = filter_matrices(model, model.parameters);
  RecordingsLikelihood likelihood(model, digests);
  if (const FilterStatus start = likelihood.status_at_start(); start != FilterStatus::ok) {
    throw InputError({model.source, 0, 0}, describe(start), "a model for which the digest was made",
                     "'identikal digest' makes another");
  }
  Objective& objective = estimate.objective;
  objective.log_likelihood = likelihood.evaluate(model.parameters, false)->value;
  objective.samples = static_cast<long>(likelihood.samples());
  objective.rows = objective.samples / static_cast<long>(as_linear(model).C.constant.rows());
  Optimality found = test_optimality(model, digests);
  estimate.tests = std::move(found.tests);
  const Model freed = with_free_noise(model);
  const Retuned better = retuned(freed, digests);
  if (!std::isnan(better.gain)) {
    estimate.derived.push_back({"excess mean-square error", "%", 100.0 * better.loss, kNone});
    if (!found.optimal) {
      const std::vector<NoiseGain> changes = changes_in_order(freed, better.parameters, digests);
      report_better(better, changes, estimate);
      say_distance(better, changes, found);
    }
  }
  estimate.findings.push_back(make_finding(FindingCode::insufficient_power, {},
                                           "a digest has no samples: of the tests the score of Q "
                                           "and R is left, which sees no fault that "
                                           "no noise explains",
                                           "'check' a recording"));
  report_verdict(found, estimate);
  conclude(estimate, "no test rejects optimality", Basis::tests);
  return estimate;
}

}  // namespace identikal
