#include "jobs/quantity.h"

#include <algorithm>
#include <cmath>
#include <set>

#include <fmt/format.h>

#include "lib/base/error.h"
#include "lib/data/units.h"

namespace identikal {

void refuse_twice(const std::string& option, const std::vector<std::string>& assignments) {
  std::set<std::string> names;
  for (const std::string& assignment : assignments) {
    std::string name = assignment.substr(0, assignment.find('='));
    name.erase(std::remove(name.begin(), name.end(), ' '), name.end());
    if (names.insert(name).second) continue;
    throw InputError({}, fmt::format("'{}' is set twice with {}", name, option), "once");
  }
}

double quantity(const std::string& option, const std::string& text, const std::string& kind) {
  std::size_t used = 0;
  double value = 0.0;
  try {
    value = std::stod(text, &used);
  } catch (const std::exception&) {
    throw InputError({}, fmt::format("{} '{}' is not a quantity", option, text),
                     "a number, with a unit or in " + kind);
  }
  const std::string rest = text.substr(used);
  const auto unit = parse_unit(rest.find_first_not_of(' ') == std::string::npos ? kind : rest);
  if (!unit || !same_dimension(*unit, *parse_unit(kind)) || !std::isfinite(value)) {
    throw InputError({}, fmt::format("{} '{}' is not a quantity", option, text),
                     "a number, with a unit or in " + kind);
  }
  return unit->to_si(value);
}

double percentage(const std::string& option, const std::string& text) {
  const double value = quantity(option, text, "%");
  if (!text.ends_with('%') && value != 0.0 && std::abs(value) <= 0.01) {
    throw InputError({},
                     fmt::format("{} '{}' may be {:.4g} % or {:.4g} %", option, text, 100.0 * value,
                                 1e4 * value),
                     "a number with '%'");
  }
  return value;
}

double hold_out_share(const std::string& text) {
  const double share = quantity("--hold-out", text, "%");
  if (!(share >= 0.05 && share <= 0.8)) {
    throw InputError({}, fmt::format("--hold-out '{}' leaves too little", text), "5% to 80%");
  }
  return share;
}

TimeRange parse_range(const std::string& text) {
  TimeRange range;
  if (text.empty()) return range;
  const std::size_t colon = text.find(':');
  if (colon == std::string::npos) {
    throw InputError({}, fmt::format("--range '{}' is not a range", text), "FROM:TO, e.g. 10s:95s");
  }
  const std::string from = text.substr(0, colon), to = text.substr(colon + 1);
  if (!from.empty()) range.from = quantity("--range", from, "s");
  if (!to.empty()) range.to = quantity("--range", to, "s");
  return range;
}

}  // namespace identikal
