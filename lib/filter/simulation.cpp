#include "lib/filter/simulation.h"

#include <stdexcept>

#include "lib/filter/steady_state.h"

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

VectorXd drawn_start(const StateSpace& model, InitialState initial, Random& random) {
  if (initial == InitialState::stationary) {
    const auto P = solve_discrete_lyapunov(model.A, model.G * model.Q * model.G.transpose());
    if (!P) throw std::invalid_argument("simulate_outputs: a stationary start needs a stable A");
    return semidefinite_factor(*P) * random.normal(model.states());
  }
  if (initial == InitialState::given) {
    return model.x0 + semidefinite_factor(model.P0) * random.normal(model.states());
  }
  if (initial == InitialState::diffuse) return VectorXd::Zero(model.states());
  if (model.P0.hasNaN())
    throw std::invalid_argument("simulate_outputs: a stationary start needs a stable A");
  const auto known = [](double variance) { return std::isinf(variance) ? 0.0 : variance; };
  return model.x0 + semidefinite_factor(model.P0.unaryExpr(known)) * random.normal(model.states());
}

void check_inputs(const StateSpace& model, const MatrixXd& u, Index samples) {
  check_shapes(model);
  if (u.size() > 0 && (u.rows() != model.inputs() || u.cols() != samples)) {
    throw std::invalid_argument("simulate_outputs: u does not fit the model and the samples");
  }
}

// One sample of the output; x moves on. @param factor  of the covariance of [w; v]
VectorXd draw(const StateSpace& model, const MatrixXd& factor, const MatrixXd& u, Index t,
              Random& random, VectorXd& x) {
  const Index nw = model.G.cols(), ny = model.outputs();
  const VectorXd noise = factor * random.normal(nw + ny);
  VectorXd next = model.A * x + model.G * noise.head(nw);
  VectorXd y = model.C * x + noise.tail(ny);
  if (u.size() > 0) {
    y += model.D * u.col(t);
    next += model.B * u.col(t);
  }
  x.swap(next);
  return y;
}

}  // namespace

MatrixXd simulate_outputs(const StateSpace& model, InitialState initial, const MatrixXd& u,
                          Index samples, Random& random, MatrixXd* states) {
  check_inputs(model, u, samples);
  const MatrixXd factor = semidefinite_factor(joint_covariance(model));
  VectorXd x = drawn_start(model, initial, random);
  MatrixXd y(model.outputs(), samples);
  if (states != nullptr) states->resize(model.states(), samples);
  for (Index t = 0; t < samples; ++t) {
    if (states != nullptr) states->col(t) = x;
    y.col(t) = draw(model, factor, u, t, random, x);
  }
  return y;
}

MatrixXd simulate_outputs(const ModelAt& model, InitialState initial, const MatrixXd& u,
                          Index samples, Random& random, MatrixXd* states) {
  StateSpace now;
  model(0, now, nullptr);
  check_inputs(now, u, samples);
  VectorXd x = drawn_start(now, initial, random);
  MatrixXd y(now.outputs(), samples);
  if (states != nullptr) states->resize(now.states(), samples);
  for (Index t = 0; t < samples; ++t) {
    if (t > 0) model(t, now, nullptr);
    if (states != nullptr) states->col(t) = x;
    y.col(t) = draw(now, semidefinite_factor(joint_covariance(now)), u, t, random, x);
  }
  return y;
}

}  // namespace identikal
