#include "studies/study.h"

#include <algorithm>

#include <fmt/format.h>

#include "lib/base/error.h"
#include "lib/base/nearest_name.h"
#include "studies/colour.h"
#include "studies/detection.h"
#include "studies/figures.h"
#include "studies/optimality.h"
#include "studies/tables.h"
#include "studies/vehicle.h"

namespace identikal {
namespace {

const std::vector<Study>& studies() {
  static const std::vector<Study> all = [] {
    std::vector<Study> out = optimality_studies();
    for (Study& table : table_studies()) out.push_back(std::move(table));
    for (Study& figure : figure_studies()) out.push_back(std::move(figure));
    for (Study& figure : detection_studies()) out.push_back(std::move(figure));
    for (Study& each : colour_studies()) out.push_back(std::move(each));
    for (Study& each : vehicle_studies()) out.push_back(std::move(each));
    return out;
  }();
  return all;
}

}  // namespace

std::vector<std::string> study_names() {
  std::vector<std::string> out;
  for (const Study& each : studies()) out.push_back(each.name);
  return out;
}

std::string study_ranges() {
  struct Range {
    std::string before;  // the number
    int from, to;        // 0: no number
  };
  std::vector<Range> ranges;
  for (const std::string& name : study_names()) {
    const std::size_t digits = name.find_last_not_of("0123456789") + 1;
    const int number = digits < name.size() ? std::stoi(name.substr(digits)) : 0;
    const std::string before = name.substr(0, digits);
    const auto found = std::find_if(ranges.begin(), ranges.end(),
                                    [&](const Range& r) { return r.before == before; });
    if (found == ranges.end()) {
      ranges.push_back({before, number, number});
    } else {
      found->from = std::min(found->from, number);
      found->to = std::max(found->to, number);
    }
  }
  std::string out;
  for (const Range& r : ranges) {
    out += (out.empty() ? "" : ", ") + r.before;
    if (r.to > 0) out += fmt::format("{} to {}", r.from, r.to);
  }
  return out;
}

StudyReport study(const std::string& name, const StudyOptions& options) {
  const auto found = std::find_if(studies().begin(), studies().end(),
                                  [&name](const Study& s) { return name == s.name; });
  if (found == studies().end()) {
    throw InputError({}, fmt::format("unknown study '{}'", name), study_ranges(),
                     did_you_mean(name, study_names()));
  }
  if (found->published_runs == 0 && options.runs > 0) {
    throw InputError({}, fmt::format("--runs does not apply to '{}'", name), "",
                     "nothing in it is repeated");
  }
  StudyOptions resolved = options;
  if (resolved.runs == 0) resolved.runs = found->published_runs;
  return found->run(resolved);
}

}  // namespace identikal
