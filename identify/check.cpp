#include "identify/check.h"

#include <fmt/format.h>

#include "identify/filter_report.h"
#include "identify/suspect_data.h"
#include "lib/units.h"

namespace identikal {

Estimate check_filter(const ModelFile& model, const std::vector<Dataset>& recordings) {
  if (model.form != ModelFile::Form::linear) {
    throw InputError({model.path, 0, 0},
                     "'check' tests a Kalman filter, this model is a vehicle without noise",
                     "a linear model with Q and R", "'fit' tests the vehicle's residuals itself");
  }
  Estimate estimate;
  estimate.model_name = model.name;
  estimate.objective.method = "check";
  estimate.status = Status::ok;
  const ReportedEntries entries = reported_entries(model.parameters);
  for (std::size_t i = 0; i < entries.names.size(); ++i) {
    EstimatedParameter p;
    p.name = entries.names[i];
    p.unit = entries.units[i];
    p.value =
        parse_unit(p.unit).value_or(Unit{}).from_si(entries.value[static_cast<Eigen::Index>(i)]);
    p.start = p.value;
    p.fixed = true;
    estimate.parameters.push_back(std::move(p));
  }
  const std::vector<FilterResult> filters =
      describe_filter(estimate, model, model.parameters, recordings);
  if (estimate.tests.empty()) {
    throw InputError({recordings[0].name, 0, 0}, "no sample is left to test",
                     "at least one measured row");
  }

  warn_of_suspect_data(estimate, model, model.parameters, recordings, filters);
  std::string failed;
  for (const TestResult& test : estimate.tests) {
    if (test.pass) continue;
    failed += failed.empty() ? "" : "; ";
    if (test.id != "nis") {
      failed +=
          fmt::format("innovations of '{}' are correlated (p = {:.2g})", test.channel, test.p);
    } else if (test.value > test.interval[1]) {
      failed += fmt::format(
          "innovations are {:.3g} times as large (in variance) as the filter believes: Q or R is "
          "too small",
          test.value);
    } else {
      failed += fmt::format(
          "innovations are {:.3g} times as large (in variance) as the filter believes: Q or R is "
          "too large",
          test.value);
    }
  }
  estimate.message = failed.empty() ? "no test rejects optimality" : "not optimal: " + failed;
  if (!failed.empty()) estimate.status = Status::answer_no;
  return estimate;
}

}  // namespace identikal
