#include "identify/model/starting_state.h"

#include <limits>

#include "identify/model/own_parameters.h"

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

VectorXd formula_parameters(const FormulaModel& model, const ParameterSet& at) {
  VectorXd out(model.equations.parameters);
  for (Index i = 0; i < out.size(); ++i) out[i] = at[static_cast<std::size_t>(i)].scalar();
  return out;
}

Equilibrium starting_state(const FormulaModel& model, const Eigen::Ref<const VectorXd>& p,
                           const Eigen::Ref<const VectorXd>& x0, const Dataset& recording) {
  const NonlinearModel& equations = model.equations;
  if (!model.rests_at) {
    return {true, x0, MatrixXd::Identity(equations.states, equations.states),
            MatrixXd::Zero(equations.states, equations.columns)};
  }
  VectorXd u = recording.u.col(0);
  for (std::size_t i = 0; i < model.rests_at->size(); ++i) {
    if (const auto& given = (*model.rests_at)[i]) u[static_cast<Index>(i)] = *given;
  }
  ModelMemory memory = make_memory(equations);
  set_parameters(equations, memory, p);
  Equilibrium out = equilibrium(equations, memory, x0, u);
  if (!out.found) out.x.setConstant(std::numeric_limits<double>::quiet_NaN());
  return out;
}

Equilibrium starting_state(const Model& model, const Dataset& recording) {
  const FormulaModel& formulas = as_formulas(model);
  const ParameterSet at = values_in(model.parameters, recording);
  return starting_state(formulas, formula_parameters(formulas, at),
                        written_matrices(formulas.noise, at).x0, recording);
}

}  // namespace identikal
