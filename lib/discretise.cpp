#include "lib/discretise.h"

#include <stdexcept>

#include <unsupported/Eigen/MatrixFunctions>

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

// exp of X, and its derivative in the direction dX.
struct Exponential {
  MatrixXd value, derivative;
};
Exponential exponential(const MatrixXd& X, const MatrixXd* dX) {
  const Index n = X.rows();
  if (dX == nullptr) return {X.exp(), {}};
  MatrixXd both = MatrixXd::Zero(2 * n, 2 * n);
  both.topLeftCorner(n, n) = both.bottomRightCorner(n, n) = X;
  both.topRightCorner(n, n) = *dX;
  const MatrixXd e = both.exp();
  return {e.topLeftCorner(n, n), e.topRightCorner(n, n)};
}

void check(const StateSpace& m, ProcessNoise noise, double step) {
  check_shapes(m);
  if (!(step > 0.0)) throw std::invalid_argument("discretise: the step is not positive");
  if (noise == ProcessNoise::density && !m.S.isZero(0.0)) {
    throw std::invalid_argument("discretise: S has no meaning with a noise density");
  }
}

// [A, B; 0, 0] h: its exponential holds Phi and Gamma.
MatrixXd driven(const MatrixXd& A, const MatrixXd& B, double step) {
  const Index n = A.rows();
  MatrixXd X = MatrixXd::Zero(n + B.cols(), n + B.cols());
  X.topLeftCorner(n, n) = step * A;
  X.topRightCorner(n, B.cols()) = step * B;
  return X;
}

// [-A, W; 0, A'] h: its exponential holds Phi^-1 Qd and Phi'.
MatrixXd noisy(const MatrixXd& A, const MatrixXd& W, double step) {
  const Index n = A.rows();
  MatrixXd X = MatrixXd::Zero(2 * n, 2 * n);
  X.topLeftCorner(n, n) = -step * A;
  X.topRightCorner(n, n) = step * W;
  X.bottomRightCorner(n, n) = step * A.transpose();
  return X;
}

}  // namespace

StateSpace discretise(const StateSpace& continuous, ProcessNoise noise, double step) {
  check(continuous, noise, step);
  const Index n = continuous.states(), nu = continuous.inputs();
  StateSpace out = continuous;
  out.dt = step;
  const MatrixXd e = driven(continuous.A, continuous.B, step).exp();
  out.A = e.topLeftCorner(n, n);
  out.B = e.topRightCorner(n, nu);
  if (noise == ProcessNoise::density) {
    const MatrixXd W = continuous.G * continuous.Q * continuous.G.transpose();
    const MatrixXd half = noisy(continuous.A, W, step).exp().topRightCorner(n, n);
    out.Q = out.A * half;
    out.Q = 0.5 * (out.Q + out.Q.transpose()).eval();
    out.G = MatrixXd::Identity(n, n);
    out.S = MatrixXd::Zero(n, continuous.outputs());
  }
  return out;
}

StateSpace discretise_derivative(const StateSpace& continuous, const StateSpace& by,
                                 ProcessNoise noise, double step) {
  check(continuous, noise, step);
  const Index n = continuous.states(), nu = continuous.inputs();
  StateSpace out = by;
  out.dt = step;
  const MatrixXd dX = driven(by.A, by.B, step);
  const Exponential e = exponential(driven(continuous.A, continuous.B, step), &dX);
  const MatrixXd Phi = e.value.topLeftCorner(n, n);
  out.A = e.derivative.topLeftCorner(n, n);
  out.B = e.derivative.topRightCorner(n, nu);
  if (noise == ProcessNoise::density) {
    const MatrixXd& G = continuous.G;
    const MatrixXd cross = by.G * continuous.Q * G.transpose();
    const MatrixXd W = G * continuous.Q * G.transpose(),
                   dW = cross + cross.transpose() + G * by.Q * G.transpose();
    const MatrixXd dN = noisy(by.A, dW, step);
    const Exponential half = exponential(noisy(continuous.A, W, step), &dN);
    out.Q = out.A * half.value.topRightCorner(n, n) + Phi * half.derivative.topRightCorner(n, n);
    out.Q = 0.5 * (out.Q + out.Q.transpose()).eval();
    out.G = MatrixXd::Zero(n, n);
    out.S = MatrixXd::Zero(n, continuous.outputs());
  }
  return out;
}

}  // namespace identikal
