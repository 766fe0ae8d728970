#include "identify/optimality/check.h"

#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "identify/estimate/parameter_table.h"
#include "identify/filter/outliers.h"
#include "identify/filter/recordings_check.h"
#include "identify/filter/report.h"
#include "identify/model/check.h"
#include "identify/optimality/breaks.h"
#include "identify/optimality/optimality.h"
#include "identify/optimality/score_statistic.h"
#include "lib/data/units.h"

namespace identikal {

using Eigen::Index;

namespace {

// Below this no test has its stated error.
constexpr Index kFewestInnovations = 20;

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
  const Retuned better = retuned(with_free_noise(model), recordings);
  if (changes(model)) {
    estimate.notes.emplace_back(
        "no excess mean-square error: a model that changes from sample to sample has no steady "
        "filter");
  } else if (is_formula_model(model)) {
    estimate.notes.emplace_back(
        "no excess mean-square error: a nonlinear model has no steady filter; its tests take the "
        "innovations for Gaussian");
  } else {
    estimate.derived.push_back({"excess mean-square error", "%", 100.0 * better.loss, kNone});
  }
  if (!found.optimal && !std::isnan(better.gain)) {
    const ReportedEntries to = reported_entries(better.parameters);
    std::string values;
    for (std::size_t i = 0; i < to.names.size(); ++i) {
      if (better.parameters[to.parameter[i]].fixed) continue;
      const Unit unit = unit_or_dimensionless(to.units[i]);
      values += fmt::format("{}{} = {:.4g}", values.empty() ? "" : ", ", to.names[i],
                            unit.from_si(to.value[i]));
    }
    estimate.notes.push_back(fmt::format(
        "a few scoring steps gain {:.4g} in log-likelihood and lead to {}; 'tune' estimates them",
        better.gain, values));
  }
  append(estimate.findings,
         check_outliers_and_offset(model, model.parameters, recordings, filters));
  append(estimate.findings, found.findings);
  for (const Break& jump : find_breaks(model, recordings)) {
    estimate.notes.push_back(sentence(jump, model, recordings));
  }
  if (!found.optimal) {
    const std::string faults = fmt::format("{}", fmt::join(found.faults, "; "));
    estimate.findings.push_back(make_finding(
        FindingCode::test_rejects, {}, "not optimal" + (faults.empty() ? "" : ": " + faults)));
  }
  conclude(estimate, "no test rejects optimality", Basis::tests);
  return estimate;
}

}  // namespace identikal
