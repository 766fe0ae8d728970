#include "identify/noise/internal/moved_estimates.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "identify/estimate/parameter_table.h"
#include "identify/model/noise_entries.h"
#include "lib/data/units.h"

namespace identikal {

std::vector<MovedEstimate> moved_estimates(const Model& from, const Model& to,
                                           const NoiseEstimate& estimate) {
  constexpr double kErrors = 2.0, kShare = 0.05;
  const std::vector<EntryDerivative> entries = entry_derivatives(from.parameters);
  const std::vector<bool> noise = entries_of_noise(from);
  std::vector<MovedEstimate> out;
  for (std::size_t e = 0; e < entries.size(); ++e) {
    const Parameter& here = from.parameters[static_cast<std::size_t>(entries[e].parameter)];
    const int place = find_parameter(to.parameters, here.name);
    const EstimatedParameter* p = reported(estimate, here.name);
    if (noise[e] || place < 0 || p == nullptr || here.value.size() != 1) continue;
    const double there = to.parameters[static_cast<std::size_t>(place)].scalar();
    const double se = p->se * unit_or_dimensionless(p->unit).scale;
    const double shift = std::abs(there - here.scalar());
    if (shift > kErrors * se && shift > kShare * std::abs(here.scalar())) {
      out.push_back({here.name, there, shift / se});
    }
  }
  std::sort(out.begin(), out.end(),
            [](const auto& a, const auto& b) { return a.errors > b.errors; });
  return out;
}

std::string in_words(const MovedEstimate& moved, const NoiseEstimate& estimate) {
  const EstimatedParameter& p = *reported(estimate, moved.name);
  return fmt::format("{} would be {:.4g} in place of {:.4g}{}{} ({:.2g} standard errors away)",
                     moved.name, unit_or_dimensionless(p.unit).from_si(moved.instead), p.value,
                     p.unit.empty() ? "" : " ", p.unit, moved.errors);
}

}  // namespace identikal
