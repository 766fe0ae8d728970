#include "lib/linear_model.h"

namespace identikal {
namespace {

double& entry(Eigen::MatrixXd& M, const ParametrisedMatrix::Entry& e) { return M(e.row, e.col); }
double& entry(Eigen::VectorXd& v, const ParametrisedMatrix::Entry& e) { return v(e.row); }

template <class Matrix>
void set_value(const ParametrisedMatrix& matrix, const ParameterSet& parameters, Matrix& out) {
  if (matrix.block >= 0) {
    out = parameters[static_cast<std::size_t>(matrix.block)].value;
    return;
  }
  out = matrix.constant;
  for (const ParametrisedMatrix::Entry& e : matrix.entries) {
    entry(out, e) += e.factor * parameters[static_cast<std::size_t>(e.parameter)].scalar();
  }
}

template <class Matrix>
void set_derivative(const ParametrisedMatrix& matrix, const ParameterSet& parameters,
                    const EntryDerivative& d, Matrix& out) {
  if (matrix.block >= 0) {
    if (matrix.block == d.parameter) {
      out = d.value;
    } else {
      const Eigen::MatrixXd& value = parameters[static_cast<std::size_t>(matrix.block)].value;
      out = Matrix::Zero(value.rows(), value.cols());
    }
    return;
  }
  out = Matrix::Zero(matrix.constant.rows(), matrix.constant.cols());
  for (const ParametrisedMatrix::Entry& e : matrix.entries) {
    if (e.parameter == d.parameter) entry(out, e) += e.factor * d.value(0, 0);
  }
}

}  // namespace

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
  set_value(model.A, parameters, out.A);
  set_value(model.B, parameters, out.B);
  set_value(model.C, parameters, out.C);
  set_value(model.D, parameters, out.D);
  set_value(model.G, parameters, out.G);
  set_value(model.Q, parameters, out.Q);
  set_value(model.R, parameters, out.R);
  set_value(model.S, parameters, out.S);
  out.dt = model.dt;
  if (model.initial == InitialState::given) {
    set_value(model.x0, parameters, out.x0);
    set_value(model.P0, parameters, out.P0);
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
  return model.continuous && model.hold == InputHold::linear ? with_next_sample(u) : u;
}

std::vector<StateSpace> model_derivatives(const LinearModel& model,
                                          const ParameterSet& parameters) {
  std::vector<StateSpace> out;
  for (const EntryDerivative& by : entry_derivatives(parameters)) {
    StateSpace s;
    set_derivative(model.A, parameters, by, s.A);
    set_derivative(model.B, parameters, by, s.B);
    set_derivative(model.C, parameters, by, s.C);
    set_derivative(model.D, parameters, by, s.D);
    set_derivative(model.G, parameters, by, s.G);
    set_derivative(model.Q, parameters, by, s.Q);
    set_derivative(model.R, parameters, by, s.R);
    set_derivative(model.S, parameters, by, s.S);
    s.dt = model.dt;
    if (model.initial == InitialState::given) {
      set_derivative(model.x0, parameters, by, s.x0);
      set_derivative(model.P0, parameters, by, s.P0);
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
