#include "identify/result/values.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include <fmt/format.h>

#include "identify/model/matrix_reader.h"
#include "identify/model/own_parameters.h"
#include "identify/model/simulation_model.h"
#include "lib/base/error.h"
#include "lib/base/nearest_name.h"
#include "lib/data/units.h"
#include "lib/model/parameter.h"

namespace identikal {

Model simulated_in(const Estimate& result, Model model) {
  bool any = false, all_in_si = true;
  for (const EstimatedParameter& p : result.parameters) {
    const bool is_made =
        p.name.starts_with(kVarianceName) && find_parameter(model.parameters, p.name) < 0;
    any = any || is_made;
    all_in_si = all_in_si && !(is_made && !p.unit.empty());
  }
  return without_process_noise(std::move(model), any && all_in_si);
}

void set_values(Model& model, const Estimate& result, const std::string& path) {
  const Location here{path, 0, 0};
  const std::string hint = "a result of this model, as '-o' wrote it";
  ParameterSet all = model.parameters;
  for (Parameter& p : all) p.fixed = false;
  const ReportedEntries known = reported_entries(all);
  std::vector<bool> given(known.names.size(), false);
  Eigen::VectorXd entries = known.value;
  for (const EstimatedParameter& p : result.parameters) {
    const auto at = std::find(known.names.begin(), known.names.end(), p.name);
    // Where a recording began is nothing that another one shares.
    const bool of_start = result.objective.method == kSimulationMethod &&
                          p.name.find(kStartName) != std::string::npos;
    if (at == known.names.end() && of_start) continue;
    if (at == known.names.end() && own_parameter_named(model, p.name) >= 0) {
      if (!std::isfinite(p.value)) {
        throw InputError(here, fmt::format("'{}' has no value", p.name), hint);
      }
      model.recordings.found[p.name] = unit_or_dimensionless(p.unit).to_si(p.value);
      continue;
    }
    if (at == known.names.end()) {
      throw InputError(here, fmt::format("{} has no parameter '{}'", model.source, p.name), hint,
                       did_you_mean(p.name, known.names));
    }
    const auto i = static_cast<std::size_t>(at - known.names.begin());
    const Unit unit = unit_or_dimensionless(p.unit);
    if (!same_dimension(unit, unit_or_dimensionless(known.units[i]))) {
      const auto named = [](const std::string& text) { return text.empty() ? "no unit" : text; };
      throw InputError(here, fmt::format("'{}' is in {}", p.name, named(p.unit)),
                       fmt::format("{}, as in {}", named(known.units[i]), model.source));
    }
    if (std::isnan(p.value)) {
      throw InputError(here, fmt::format("'{}' has no value", p.name), hint);
    }
    entries[i] = unit.to_si(p.value);
    given[i] = true;
  }
  for (std::size_t i = 0; i < given.size(); ++i) {
    const Parameter& p = model.parameters[known.parameter[i]];
    if (given[i] || p.fixed || has_own_values(model, known.parameter[i])) continue;
    throw InputError(
        here, fmt::format("has no value of '{}', which {} seeks", known.names[i], model.source),
        hint);
  }
  all = with_entries(std::move(all), entries);
  for (std::size_t i = 0; i < all.size(); ++i) all[i].fixed = model.parameters[i].fixed;
  if (has_filter(model)) {
    if (const std::optional<ModelFault> fault = fault_at(noise_model(model), all)) {
      throw InputError(here, fault->text + " with the values of this result", hint);
    }
  }
  model.parameters = std::move(all);
  if (is_formula_model(model) && !changes(model) && !result.objective.filter.empty()) {
    as_formulas(model).filter = nonlinear_method(result.objective.filter, here);
  }
}

}  // namespace identikal
