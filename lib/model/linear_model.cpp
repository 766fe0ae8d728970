#include "lib/model/linear_model.h"

#include <algorithm>
#include <array>
#include <set>
#include <stdexcept>

#include "lib/base/message.h"

namespace identikal {
namespace {

// Values of all formulas of a model and, where requested, their derivatives with respect to the
// parameters.
struct FormulaValues {
  std::vector<std::vector<double>> value, slope;  // per tape; jacobian row by row

  FormulaValues(const LinearModel& model, const ParameterSet& parameters, bool with_jacobian) {
    for (const EntryFormulas& formulas : model.formulas) {
      const Tape& tape = formulas.tape;
      TapeMemory memory = make_memory(tape);
      for (std::size_t i = 0; i < tape.columns; ++i) {
        memory[static_cast<std::size_t>(formulas.first) + i] = parameters[i].scalar();
      }
      evaluate_held(tape, memory);
      value.emplace_back(tape.values);
      if (with_jacobian) {
        slope.emplace_back(tape.values * tape.columns);
        evaluate_jacobian(tape, memory, value.back(), slope.back());
      } else {
        evaluate_values(tape, memory, value.back());
      }
    }
  }
  double at(const ParametrisedMatrix::Formula& f) const { return value[f.tape][f.value]; }
  double by(const ParametrisedMatrix::Formula& f, int parameter, const LinearModel& model) const {
    const auto tape = static_cast<std::size_t>(f.tape);
    const std::size_t columns = model.formulas[tape].tape.columns;
    const auto column = static_cast<std::size_t>(parameter);
    return column < columns ? slope[tape][static_cast<std::size_t>(f.value) * columns + column]
                            : 0.0;
  }
};

double& entry(Eigen::MatrixXd& M, int row, int col) { return M(row, col); }
double& entry(Eigen::VectorXd& v, int row, int) { return v(row); }

void check_entries(const ParametrisedMatrix& matrix, const ParameterSet& parameters) {
  const Eigen::Index rows = matrix.constant.rows(), cols = matrix.constant.cols();
  for (const ParametrisedMatrix::Entry& e : matrix.entries) {
    const bool inside = e.row >= 0 && e.row < rows && e.col >= 0 && e.col < cols;
    if (inside && e.parameter >= 0 && e.parameter < static_cast<int>(parameters.size())) continue;
    throw std::invalid_argument(
        message({"linear model: an entry at (", e.row, ", ", e.col, ") of parameter ", e.parameter,
                 " in a ", rows, " x ", cols, " matrix with ", parameters.size(), " parameters"}));
  }
}

template <class Matrix>
void set_value(const ParametrisedMatrix& matrix, const ParameterSet& parameters,
               const FormulaValues& formulas, Matrix& out) {
  if (matrix.block >= 0) {
    out = parameters[matrix.block].value;
    return;
  }
  out = matrix.constant;
  check_entries(matrix, parameters);
  for (const ParametrisedMatrix::Entry& e : matrix.entries) {
    entry(out, e.row, e.col) += e.factor * parameters[e.parameter].scalar();
  }
  for (const ParametrisedMatrix::Formula& f : matrix.formulas) {
    entry(out, f.row, f.col) += formulas.at(f);
  }
}

template <class Matrix>
void set_derivative(const ParametrisedMatrix& matrix, const ParameterSet& parameters,
                    const LinearModel& model, const FormulaValues& formulas,
                    const EntryDerivative& d, Matrix& out) {
  if (matrix.block >= 0) {
    if (matrix.block == d.parameter) {
      out = d.value;
    } else {
      const Eigen::MatrixXd& value = parameters[matrix.block].value;
      out = Matrix::Zero(value.rows(), value.cols());
    }
    return;
  }
  check_entries(matrix, parameters);
  out = Matrix::Zero(matrix.constant.rows(), matrix.constant.cols());
  for (const ParametrisedMatrix::Entry& e : matrix.entries) {
    if (e.parameter == d.parameter) entry(out, e.row, e.col) += e.factor * d.value(0, 0);
  }
  for (const ParametrisedMatrix::Formula& f : matrix.formulas) {
    entry(out, f.row, f.col) += formulas.by(f, d.parameter, model) * d.value(0, 0);
  }
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

bool is_known(const ParametrisedMatrix& matrix, const ParameterSet& parameters) {
  const std::vector<int> in = parameters_in(matrix);
  return std::all_of(in.begin(), in.end(), [&](int p) { return parameters[p].fixed; });
}

namespace {

bool is_known(const ParametrisedMatrix::Formula& formula, const ParameterSet& parameters) {
  return std::all_of(formula.parameters.begin(), formula.parameters.end(),
                     [&](int p) { return parameters[p].fixed; });
}

template <class Model>
auto matrices_of(Model& model) {
  return std::array{&model.A, &model.B, &model.C, &model.D,  &model.G,
                    &model.Q, &model.R, &model.S, &model.x0, &model.P0};
}

}  // namespace

bool is_linear_in_parameters(const LinearModel& model, const ParameterSet& parameters) {
  for (const ParametrisedMatrix* matrix : matrices_of(model)) {
    for (const ParametrisedMatrix::Formula& f : matrix->formulas) {
      if (!is_known(f, parameters)) return false;
    }
  }
  return true;
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

namespace {

void set_written(const LinearModel& model, const ParameterSet& parameters, StateSpace& out) {
  const FormulaValues formulas(model, parameters, false);
  set_value(model.A, parameters, formulas, out.A);
  set_value(model.B, parameters, formulas, out.B);
  set_value(model.C, parameters, formulas, out.C);
  set_value(model.D, parameters, formulas, out.D);
  set_value(model.G, parameters, formulas, out.G);
  set_value(model.Q, parameters, formulas, out.Q);
  set_value(model.R, parameters, formulas, out.R);
  set_value(model.S, parameters, formulas, out.S);
  out.dt = model.dt;
  if (model.initial == InitialState::given) {
    set_value(model.x0, parameters, formulas, out.x0);
    set_value(model.P0, parameters, formulas, out.P0);
  } else {
    out.x0.setZero(out.states());
    out.P0.setZero(out.states(), out.states());
  }
}

}  // namespace

StateSpace written_matrices(const LinearModel& model, const ParameterSet& parameters) {
  StateSpace out;
  set_written(model, parameters, out);
  return out;
}

void instantiate(const LinearModel& model, const ParameterSet& parameters, StateSpace& out) {
  if (model.continuous) {
    out = discretise(written_matrices(model, parameters), model.noise, model.dt, model.hold);
  } else {
    set_written(model, parameters, out);
  }
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
    const auto derive = [&](const ParametrisedMatrix& matrix, auto& to) {
      set_derivative(matrix, parameters, model, formulas, by, to);
    };
    derive(model.A, s.A);
    derive(model.B, s.B);
    derive(model.C, s.C);
    derive(model.D, s.D);
    derive(model.G, s.G);
    derive(model.Q, s.Q);
    derive(model.R, s.R);
    derive(model.S, s.S);
    s.dt = model.dt;
    if (model.initial == InitialState::given) {
      derive(model.x0, s.x0);
      derive(model.P0, s.P0);
    } else {
      s.x0.setZero(s.states());
      s.P0.setZero(s.states(), s.states());
    }
    if (model.continuous) {
      s = discretise_derivative(written_matrices(model, parameters), s, model.noise, model.dt,
                                model.hold);
    }
    out.push_back(std::move(s));
  }
  return out;
}

}  // namespace identikal
