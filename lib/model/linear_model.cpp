#include "lib/model/linear_model.h"

#include <algorithm>
#include <array>
#include <set>
#include <stdexcept>

#include "lib/base/message.h"
#include "lib/model/internal/formula_values.h"
#include "lib/model/partly_diffuse.h"

namespace identikal {
namespace {

template <class Model>
auto matrices_of(Model& model) {
  return std::array{&model.A, &model.B, &model.C, &model.D,  &model.G,
                    &model.Q, &model.R, &model.S, &model.x0, &model.P0};
}

}  // namespace

std::vector<int> parameters_in(const ParametrisedMatrix& matrix) {
  std::set<int> out;
  if (matrix.block >= 0) out.insert(matrix.block);
  for (const ParametrisedMatrix::Entry& e : matrix.entries) out.insert(e.parameter);
  for (const ParametrisedMatrix::Formula& f : matrix.formulas) {
    out.insert(f.parameters.begin(), f.parameters.end());
  }
  return {out.begin(), out.end()};
}

bool moves(const ParametrisedMatrix& matrix) {
  return std::any_of(matrix.formulas.begin(), matrix.formulas.end(),
                     [](const ParametrisedMatrix::Formula& f) { return f.moves; });
}

bool holds_moving(const LinearModel& model) {
  const auto all = matrices_of(model);
  return std::any_of(all.begin(), all.end(), [](const auto* matrix) { return moves(*matrix); });
}

bool changes(const LinearModel& model) { return model.irregular || holds_moving(model); }

bool is_known(const ParametrisedMatrix& matrix, const ParameterSet& parameters) {
  const std::vector<int> in = parameters_in(matrix);
  return std::all_of(in.begin(), in.end(), [&](int p) { return parameters[p].fixed; });
}

namespace {

// A number that stays the same whatever is estimated.
bool is_known(const ParametrisedMatrix::Formula& formula, const ParameterSet& parameters) {
  if (formula.moves) return false;
  return std::all_of(formula.parameters.begin(), formula.parameters.end(),
                     [&](int p) { return parameters[p].fixed; });
}

}  // namespace

bool is_linear_in_parameters(const LinearModel& model, const ParameterSet& parameters) {
  for (const ParametrisedMatrix* matrix : matrices_of(model)) {
    for (const ParametrisedMatrix::Formula& f : matrix->formulas) {
      if (!is_known(f, parameters)) return false;
    }
  }
  // P = A P A' + G Q G' is, in Q alone.
  return model.stationary.empty() ||
         (is_known(model.A, parameters) && is_known(model.G, parameters));
}

LinearModel with_known_formulas_as_numbers(LinearModel model, const ParameterSet& parameters) {
  const FormulaValues values(model, parameters, false);
  bool any_left = false;
  for (ParametrisedMatrix* matrix : matrices_of(model)) {
    std::erase_if(matrix->formulas, [&](const ParametrisedMatrix::Formula& f) {
      if (!is_known(f, parameters)) return false;
      matrix->constant(f.row, f.col) += values.at(f);
      return true;
    });
    any_left = any_left || !matrix->formulas.empty();
  }
  if (!any_left) model.formulas.clear();
  return model;
}

ParametrisedMatrix constant_matrix(Eigen::MatrixXd value) {
  ParametrisedMatrix out;
  out.constant = std::move(value);
  return out;
}

LinearModel constant_model(const StateSpace& system, InitialState initial) {
  LinearModel out;
  out.A.constant = system.A;
  out.B.constant = system.B;
  out.C.constant = system.C;
  out.D.constant = system.D;
  out.G.constant = system.G;
  out.Q.constant = system.Q;
  out.R.constant = system.R;
  out.S.constant = system.S;
  out.x0.constant = system.x0;
  out.P0.constant = system.P0;
  out.initial = initial;
  return out;
}

StateSpace written_matrices(const LinearModel& model, const ParameterSet& parameters) {
  StateSpace out;
  set_written(model, parameters, FormulaValues(model, parameters, false), out);
  return out;
}

void instantiate(const LinearModel& model, const ParameterSet& parameters, StateSpace& out) {
  if (model.continuous) {
    out = discretise(written_matrices(model, parameters), model.noise, model.dt, model.hold);
  } else {
    set_written(model, parameters, FormulaValues(model, parameters, false), out);
  }
  if (model.initial == InitialState::partly_diffuse) set_partly_diffuse_start(model, out, nullptr);
}

StateSpace instantiate(const LinearModel& model, const ParameterSet& parameters) {
  StateSpace out;
  instantiate(model, parameters, out);
  return out;
}

Eigen::MatrixXd model_inputs(const LinearModel& model, const Eigen::MatrixXd& u) {
  Eigen::MatrixXd out = u;
  if (model.offset) {
    out.conservativeResize(u.rows() + 1, u.cols());
    out.bottomRows(1).setOnes();
  }
  return model.continuous && model.hold == InputHold::linear ? with_next_sample(out) : out;
}

std::vector<StateSpace> model_derivatives(const LinearModel& model,
                                          const ParameterSet& parameters) {
  std::vector<StateSpace> out;
  const FormulaValues formulas(model, parameters, true);
  for (const EntryDerivative& by : entry_derivatives(parameters)) {
    StateSpace s;
    set_written_derivative(model, parameters, formulas, by, s);
    out.push_back(std::move(s));
  }
  if (model.continuous) {
    const std::vector<StateSpace> written = std::move(out);
    StateSpace ignored;
    discretise(written_matrices(model, parameters), written, model.noise, model.dt, model.hold,
               ignored, out);
  }
  if (model.initial == InitialState::partly_diffuse) {
    StateSpace now = instantiate(model, parameters);
    set_partly_diffuse_start(model, now, &out);
  }
  return out;
}

}  // namespace identikal
