#include "identify/model/row_order.h"

#include <algorithm>

#include "lib/base/random.h"
#include "lib/model/linear_model.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

bool is_constant(const ParametrisedMatrix& M, const MatrixXd& value) {
  return M.entries.empty() && M.formulas.empty() && M.block < 0 && M.constant == value;
}

// Formulas say so where they say it anywhere: two places tell.
bool stays(const NonlinearModel& model) {
  if (model.continuous || !model.linear_in_state) return false;
  ModelMemory memory = make_memory(model);
  Random random(1);
  set_parameters(model, memory, random.normal(model.parameters));
  const VectorXd time{{0.0, 1.0, 2.0}};
  const InputNodes nodes =
      input_nodes(time, MatrixXd::Random(model.inputs, 3), InputPath::constant, 1.0);
  for (Index k = 0; k < 2; ++k) {
    const VectorXd before = random.normal(model.states);
    VectorXd x = before;
    step(model, memory, nodes, k, x);
    if (x != before) return false;
  }
  return true;
}

}  // namespace

bool states_stay(const LinearModel& model) {
  const Index n = model.A.constant.rows();
  const MatrixXd still =
      model.continuous ? MatrixXd(MatrixXd::Zero(n, n)) : MatrixXd(MatrixXd::Identity(n, n));
  return is_constant(model.A, still) &&
         is_constant(model.B, MatrixXd::Zero(n, model.B.constant.cols()));
}

bool rows_have_no_order(const Model& model, const ParameterSet& at) {
  if (!has_filter(model)) return false;
  const LinearModel& noise = noise_model(model);
  if (noise.initial != InitialState::given) return false;
  const bool by_formulas = is_formula_model(model) && !changes(model);
  if (!(by_formulas ? stays(as_formulas(model).equations) : states_stay(noise))) return false;
  const StateSpace written = written_matrices(noise, at);
  const auto none = [](const StateSpace& each) {
    return each.Q.isZero(0.0) && each.P0.isZero(0.0);
  };
  const std::vector<StateSpace> derivatives = model_derivatives(noise, at);
  return none(written) && std::all_of(derivatives.begin(), derivatives.end(), none);
}

}  // namespace identikal
