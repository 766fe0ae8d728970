#include "lib/linear_model.h"

namespace identikal {
namespace {

Eigen::MatrixXd value_of(const ParametrisedMatrix& matrix, const ParameterSet& parameters) {
  if (matrix.block >= 0) return parameters[static_cast<std::size_t>(matrix.block)].value;
  Eigen::MatrixXd M = matrix.constant;
  for (const ParametrisedMatrix::Entry& e : matrix.entries) {
    M(e.row, e.col) += e.factor * parameters[static_cast<std::size_t>(e.parameter)].scalar();
  }
  return M;
}

Eigen::MatrixXd derivative_of(const ParametrisedMatrix& matrix, const CoordinateDerivative& d,
                              Eigen::Index rows, Eigen::Index cols) {
  if (matrix.block == d.parameter) return d.value;
  Eigen::MatrixXd M = Eigen::MatrixXd::Zero(rows, cols);
  for (const ParametrisedMatrix::Entry& e : matrix.entries) {
    if (e.parameter == d.parameter) M(e.row, e.col) += e.factor * d.value(0, 0);
  }
  return M;
}

}  // namespace

StateSpace instantiate(const LinearModel& model, const ParameterSet& parameters) {
  StateSpace out;
  out.A = value_of(model.A, parameters);
  out.B = value_of(model.B, parameters);
  out.C = value_of(model.C, parameters);
  out.D = value_of(model.D, parameters);
  out.G = value_of(model.G, parameters);
  out.Q = value_of(model.Q, parameters);
  out.R = value_of(model.R, parameters);
  out.S = value_of(model.S, parameters);
  out.dt = model.dt;
  if (model.initial == InitialState::given) {
    out.x0 = value_of(model.x0, parameters);
    out.P0 = value_of(model.P0, parameters);
  } else {
    out.x0 = Eigen::VectorXd::Zero(out.states());
    out.P0 = Eigen::MatrixXd::Zero(out.states(), out.states());
  }
  return out;
}

std::vector<StateSpace> instantiate_derivatives(const LinearModel& model,
                                                const ParameterSet& parameters) {
  const StateSpace at = instantiate(model, parameters);
  std::vector<StateSpace> out;
  for (const CoordinateDerivative& d : coordinate_derivatives(parameters)) {
    const auto of = [&d](const ParametrisedMatrix& matrix, const auto& value) {
      return derivative_of(matrix, d, value.rows(), value.cols());
    };
    StateSpace s;
    s.A = of(model.A, at.A);
    s.B = of(model.B, at.B);
    s.C = of(model.C, at.C);
    s.D = of(model.D, at.D);
    s.G = of(model.G, at.G);
    s.Q = of(model.Q, at.Q);
    s.R = of(model.R, at.R);
    s.S = of(model.S, at.S);
    s.x0 = of(model.x0, at.x0);
    s.P0 = of(model.P0, at.P0);
    s.dt = model.dt;
    out.push_back(std::move(s));
  }
  return out;
}

}  // namespace identikal
