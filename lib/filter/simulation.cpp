#include "lib/filter/simulation.h"

#include <stdexcept>

#include "lib/filter/steady_state.h"

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

MatrixXd simulate_outputs(const StateSpace& model, InitialState initial, const MatrixXd& u,
                          Index samples, Random& random, MatrixXd* states) {
  check_shapes(model);
  if (u.size() > 0 && (u.rows() != model.inputs() || u.cols() != samples)) {
    throw std::invalid_argument("simulate_outputs: u does not fit the model and the samples");
  }
  const Index n = model.states(), nw = model.G.cols(), ny = model.outputs();
  const MatrixXd factor = semidefinite_factor(joint_covariance(model));
  VectorXd x = VectorXd::Zero(n);
  if (initial == InitialState::stationary) {
    const auto P = solve_discrete_lyapunov(model.A, model.G * model.Q * model.G.transpose());
    if (!P) throw std::invalid_argument("simulate_outputs: a stationary start needs a stable A");
    x = semidefinite_factor(*P) * random.normal(n);
  } else if (initial == InitialState::given) {
    x = model.x0 + semidefinite_factor(model.P0) * random.normal(n);
  }
  MatrixXd y(ny, samples);
  if (states != nullptr) states->resize(n, samples);
  for (Index t = 0; t < samples; ++t) {
    if (states != nullptr) states->col(t) = x;
    const VectorXd noise = factor * random.normal(nw + ny);
    VectorXd next = model.A * x + model.G * noise.head(nw);
    y.col(t) = model.C * x + noise.tail(ny);
    if (u.size() > 0) {
      y.col(t) += model.D * u.col(t);
      next += model.B * u.col(t);
    }
    x.swap(next);
  }
  return y;
}

}  // namespace identikal
