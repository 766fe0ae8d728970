#include "identify/model/noise_entries.h"

#include <algorithm>

namespace identikal {

std::vector<bool> entries_of_noise(const Model& model) {
  const std::vector<EntryDerivative> entries = entry_derivatives(model.parameters);
  const std::vector<StateSpace> by = model_derivatives(noise_model(model), model.parameters);
  std::vector<bool> out;
  for (std::size_t e = 0; e < entries.size(); ++e) {
    const auto p = static_cast<std::size_t>(entries[e].parameter);
    const bool in_formulas = is_formula_model(model) &&
                             p < as_formulas(model).equations.column.size() &&
                             as_formulas(model).equations.column[p] != NonlinearModel::kInNoFormula;
    out.push_back(!in_formulas && changes_only_noise(by[e]) && !changes_start(by[e]));
  }
  return out;
}

bool moves_without_noise(const Model& model) {
  const StateSpace now = instantiate(noise_model(model), model.parameters);
  if (!(now.G * now.Q * now.G.transpose()).isZero(0.0)) return false;
  const std::vector<StateSpace> by = model_derivatives(noise_model(model), model.parameters);
  return std::all_of(by.begin(), by.end(), [](const StateSpace& d) { return d.Q.isZero(0.0); });
}

}  // namespace identikal
