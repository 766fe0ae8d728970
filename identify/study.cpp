#include "identify/study.h"

#include <algorithm>

#include <fmt/format.h>

#include "identify/study_colour.h"
#include "identify/study_detection.h"
#include "identify/study_figures.h"
#include "identify/study_optimality.h"
#include "identify/study_tables.h"
#include "identify/study_vehicle.h"
#include "lib/error.h"
#include "lib/nearest_name.h"

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

StudyReport study(const std::string& name, const StudyOptions& options) {
  const auto found = std::find_if(studies().begin(), studies().end(),
                                  [&name](const Study& s) { return name == s.name; });
  if (found == studies().end()) {
    std::string known;
    for (const std::string& each : study_names()) known += (known.empty() ? "" : ", ") + each;
    throw InputError({}, fmt::format("unknown study '{}'", name), known,
                     did_you_mean(name, study_names()));
  }
  if (found->published_runs == 0 && options.runs > 0) {
    throw InputError({}, fmt::format("--runs has no meaning for '{}'", name), "",
                     "nothing in it is repeated");
  }
  StudyOptions resolved = options;
  if (resolved.runs == 0) resolved.runs = found->published_runs;
  return found->run(resolved);
}

}  // namespace identikal
