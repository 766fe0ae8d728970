#include "lib/model/internal/formula_values.h"

#include <algorithm>
#include <stdexcept>

#include "lib/base/message.h"

namespace identikal {

using Eigen::MatrixXd;
using Eigen::VectorXd;

FormulaValues::FormulaValues(const LinearModel& model, const ParameterSet& parameters,
                             bool with_jacobian)
    : model_(model) {
  for (const EntryFormulas& formulas : model.formulas) {
    memory_.push_back(make_memory(formulas.tape));
    value_.emplace_back(formulas.tape.values);
    slope_.emplace_back(formulas.tape.values * formulas.tape.columns);
  }
  set_parameters(parameters, with_jacobian);
}

void FormulaValues::set_parameters(const ParameterSet& parameters, bool with_jacobian) {
  with_jacobian_ = with_jacobian;
  for (std::size_t k = 0; k < model_.formulas.size(); ++k) {
    const EntryFormulas& formulas = model_.formulas[k];
    for (std::size_t i = 0; i < formulas.tape.columns; ++i) {
      memory_[k][static_cast<std::size_t>(formulas.first) + i] = parameters[i].scalar();
    }
    evaluate_held(formulas.tape, memory_[k]);
  }
  move_to(model_.typical);
}

void FormulaValues::move_to(const MovingValues& sample) {
  for (std::size_t k = 0; k < model_.formulas.size(); ++k) {
    const EntryFormulas& formulas = model_.formulas[k];
    for (int i = 0; i < formulas.inputs; ++i) {
      memory_[k][static_cast<std::size_t>(formulas.first_input + i)] =
          i < sample.inputs.size() ? sample.inputs[i] : 1.0;
    }
    if (formulas.time >= 0) memory_[k][static_cast<std::size_t>(formulas.time)] = sample.time;
    evaluate(k);
  }
}

void FormulaValues::evaluate(std::size_t tape) {
  const Tape& code = model_.formulas[tape].tape;
  if (with_jacobian_) {
    evaluate_jacobian(code, memory_[tape], value_[tape], slope_[tape]);
  } else {
    evaluate_values(code, memory_[tape], value_[tape]);
  }
}

double FormulaValues::by(const ParametrisedMatrix::Formula& f, int parameter) const {
  const auto tape = static_cast<std::size_t>(f.tape);
  const std::size_t columns = model_.formulas[tape].tape.columns;
  const auto column = static_cast<std::size_t>(parameter);
  return column < columns ? slope_[tape][static_cast<std::size_t>(f.value) * columns + column]
                          : 0.0;
}

namespace {

double& entry(MatrixXd& M, int row, int col) { return M(row, col); }
double& entry(VectorXd& v, int row, int) { return v(row); }

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
void value_of(const ParametrisedMatrix& matrix, const ParameterSet& parameters,
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
void derivative_of(const ParametrisedMatrix& matrix, const ParameterSet& parameters,
                   const FormulaValues& formulas, const EntryDerivative& d, Matrix& out) {
  if (matrix.block >= 0) {
    if (matrix.block == d.parameter) {
      out = d.value;
    } else {
      const MatrixXd& value = parameters[matrix.block].value;
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
    entry(out, f.row, f.col) += formulas.by(f, d.parameter) * d.value(0, 0);
  }
}

// Calls visit(matrix as it is parametrised, as numbers) for those of the equations and, where the
// model gives it, of the start.
template <typename Visit>
void for_each_matrix(const LinearModel& model, StateSpace& out, Visit&& visit) {
  visit(model.A, out.A);
  visit(model.B, out.B);
  visit(model.C, out.C);
  visit(model.D, out.D);
  visit(model.G, out.G);
  visit(model.Q, out.Q);
  visit(model.R, out.R);
  visit(model.S, out.S);
  out.dt = model.dt;
  if (model.initial == InitialState::given) {
    visit(model.x0, out.x0);
    visit(model.P0, out.P0);
  } else {
    out.x0.setZero(out.states());
    out.P0.setZero(out.states(), out.states());
  }
}

}  // namespace

void set_value(const ParametrisedMatrix& matrix, const ParameterSet& parameters,
               const FormulaValues& formulas, MatrixXd& out) {
  value_of(matrix, parameters, formulas, out);
}

void set_value(const ParametrisedMatrix& matrix, const ParameterSet& parameters,
               const FormulaValues& formulas, VectorXd& out) {
  value_of(matrix, parameters, formulas, out);
}

void set_derivative(const ParametrisedMatrix& matrix, const ParameterSet& parameters,
                    const FormulaValues& formulas, const EntryDerivative& by, MatrixXd& out) {
  derivative_of(matrix, parameters, formulas, by, out);
}

void set_derivative(const ParametrisedMatrix& matrix, const ParameterSet& parameters,
                    const FormulaValues& formulas, const EntryDerivative& by, VectorXd& out) {
  derivative_of(matrix, parameters, formulas, by, out);
}

void set_written(const LinearModel& model, const ParameterSet& parameters,
                 const FormulaValues& formulas, StateSpace& out) {
  for_each_matrix(model, out, [&](const ParametrisedMatrix& matrix, auto& to) {
    set_value(matrix, parameters, formulas, to);
  });
}

void set_written_derivative(const LinearModel& model, const ParameterSet& parameters,
                            const FormulaValues& formulas, const EntryDerivative& by,
                            StateSpace& out) {
  for_each_matrix(model, out, [&](const ParametrisedMatrix& matrix, auto& to) {
    set_derivative(matrix, parameters, formulas, by, to);
  });
}

void set_moving(const LinearModel& model, const ParameterSet& parameters,
                const FormulaValues& formulas, StateSpace& out) {
  for_each_matrix(model, out, [&](const ParametrisedMatrix& matrix, auto& to) {
    if (moves(matrix)) set_value(matrix, parameters, formulas, to);
  });
}

void set_moving_derivative(const LinearModel& model, const ParameterSet& parameters,
                           const FormulaValues& formulas, const EntryDerivative& by,
                           StateSpace& out) {
  for_each_matrix(model, out, [&](const ParametrisedMatrix& matrix, auto& to) {
    if (moves(matrix)) set_derivative(matrix, parameters, formulas, by, to);
  });
}

}  // namespace identikal
