#include "identify/estimate/parameter_table.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "lib/data/units.h"

namespace identikal {

using Eigen::Index;

double unit_scale(const std::string& unit) { return unit_or_dimensionless(unit).scale; }

void list_parameters(Estimate& estimate, const ParameterSet& start, const ParameterSet& end) {
  const ReportedEntries before = reported_entries(start), after = reported_entries(end);
  for (std::size_t i = 0; i < after.names.size(); ++i) {
    const auto at = static_cast<Index>(i);
    EstimatedParameter p;
    p.name = after.names[i];
    p.unit = after.units[i];
    const Unit unit = unit_or_dimensionless(p.unit);
    p.value = unit.from_si(after.value[at]);
    p.start = unit.from_si(before.value[at]);
    const Parameter& parameter = end[after.parameter[i]];
    p.fixed = parameter.fixed;
    if (parameter.domain == Domain::scalar) {
      p.bounds = {unit.from_si(parameter.min), unit.from_si(parameter.max)};
    } else if (after.variance[i]) {
      p.bounds[0] = 0.0;
    }
    estimate.parameters.push_back(std::move(p));
  }
}

void list_known_parameters(Estimate& estimate, const ParameterSet& parameters) {
  list_parameters(estimate, parameters, parameters);
  for (EstimatedParameter& p : estimate.parameters) p.fixed = true;
}

const EstimatedParameter* reported(const Estimate& estimate, std::string_view name) {
  for (const EstimatedParameter& p : estimate.parameters) {
    if (p.name == name) return &p;
  }
  return nullptr;
}

double correlation_of(const Estimate& estimate, std::string_view a, std::string_view b) {
  const auto& names = estimate.correlation_names;
  const auto i = std::find(names.begin(), names.end(), a),
             j = std::find(names.begin(), names.end(), b);
  if (a == b) return 1.0;
  if (i == names.end() || j == names.end()) return 0.0;
  const double r = estimate.correlation(i - names.begin(), j - names.begin());
  return std::isfinite(r) ? r : 0.0;
}

ParameterSet parameters_of(const Estimate& estimate, const ParameterSet& parameters) {
  const ReportedEntries all = reported_entries(parameters);
  Eigen::VectorXd entries = free_entries(parameters);
  Index free = 0;
  for (std::size_t e = 0; e < all.names.size(); ++e) {
    if (parameters[static_cast<std::size_t>(all.parameter[e])].fixed) continue;
    if (const EstimatedParameter* found = reported(estimate, all.names[e])) {
      entries[free] = unit_or_dimensionless(found->unit).to_si(found->value);
    }
    ++free;
  }
  return with_entries(parameters, entries);
}

}  // namespace identikal
