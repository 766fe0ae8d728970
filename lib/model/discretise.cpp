#include "lib/model/discretise.h"

#include <cmath>
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
    throw std::invalid_argument("discretise: S does not apply to a noise density");
  }
}

// [A, B; 0, 0] h: its exponential holds Phi and Gamma. With inputs held linearly the states of the
// exponent are x, u(t) and the way from u(t) to u(t+1), which enters u with the rate 1/h.
MatrixXd driven(const MatrixXd& A, const MatrixXd& B, double step, InputHold hold, double ramp) {
  const Index n = A.rows(), nu = B.cols();
  const Index size = n + (hold == InputHold::linear ? 2 : 1) * nu;
  MatrixXd X = MatrixXd::Zero(size, size);
  X.topLeftCorner(n, n) = step * A;
  X.block(0, n, n, nu) = step * B;
  if (hold == InputHold::linear) X.block(n, n + nu, nu, nu).diagonal().setConstant(ramp);
  return X;
}

// B of the sampled model (or its derivative) from the exponential (or its derivative).
MatrixXd input_matrix(const MatrixXd& e, Index n, Index nu, InputHold hold) {
  const MatrixXd Gamma = e.block(0, n, n, nu);
  if (hold == InputHold::constant) return Gamma;
  const MatrixXd Gamma1 = e.block(0, n + nu, n, nu);
  MatrixXd B(n, 2 * nu);
  B << Gamma - Gamma1, Gamma1;
  return B;
}

MatrixXd feed_through(const MatrixXd& D, InputHold hold) {
  if (hold == InputHold::constant) return D;
  MatrixXd out = MatrixXd::Zero(D.rows(), 2 * D.cols());
  out.leftCols(D.cols()) = D;
  return out;
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

// The exponent of noisy() holds e^(-A h), which drowns e^(A h) where poles are fast: it is taken
// over a step so short that neither is large, and doubled, Qd(2 h) = Qd(h) + Phi Qd(h) Phi'.
int halvings_to_one(const MatrixXd& A, double step) {
  const double size = step * A.cwiseAbs().rowwise().sum().maxCoeff();
  return size > 1.0 && std::isfinite(size) ? static_cast<int>(std::ceil(std::log2(size))) : 0;
}

}  // namespace

StateSpace discretise(const StateSpace& continuous, ProcessNoise noise, double step,
                      InputHold hold) {
  check(continuous, noise, step);
  const Index n = continuous.states(), nu = continuous.inputs();
  StateSpace out = continuous;
  out.dt = step;
  const MatrixXd e = driven(continuous.A, continuous.B, step, hold, 1.0).exp();
  out.A = e.topLeftCorner(n, n);
  out.B = input_matrix(e, n, nu, hold);
  out.D = feed_through(continuous.D, hold);
  if (noise == ProcessNoise::density) {
    const MatrixXd W = continuous.G * continuous.Q * continuous.G.transpose();
    const int halvings = halvings_to_one(continuous.A, step);
    const double part = std::ldexp(step, -halvings);
    MatrixXd Phi = (part * continuous.A).exp();
    out.Q = Phi * noisy(continuous.A, W, part).exp().topRightCorner(n, n);
    for (int i = 0; i < halvings; ++i) {
      out.Q += (Phi * out.Q * Phi.transpose()).eval();
      Phi = (Phi * Phi).eval();
    }
    out.Q = 0.5 * (out.Q + out.Q.transpose()).eval();
    out.G = MatrixXd::Identity(n, n);
    out.S = MatrixXd::Zero(n, continuous.outputs());
  }
  return out;
}

StateSpace discretise_derivative(const StateSpace& continuous, const StateSpace& by,
                                 ProcessNoise noise, double step, InputHold hold) {
  check(continuous, noise, step);
  const Index n = continuous.states(), nu = continuous.inputs();
  StateSpace out = by;
  out.dt = step;
  const MatrixXd dX = driven(by.A, by.B, step, hold, 0.0);
  const Exponential e = exponential(driven(continuous.A, continuous.B, step, hold, 1.0), &dX);
  out.A = e.derivative.topLeftCorner(n, n);
  out.B = input_matrix(e.derivative, n, nu, hold);
  out.D = feed_through(by.D, hold);
  if (noise == ProcessNoise::density) {
    const MatrixXd& G = continuous.G;
    const MatrixXd cross = by.G * continuous.Q * G.transpose();
    const MatrixXd W = G * continuous.Q * G.transpose(),
                   dW = cross + cross.transpose() + G * by.Q * G.transpose();
    const int halvings = halvings_to_one(continuous.A, step);
    const double part = std::ldexp(step, -halvings);
    const MatrixXd dN = noisy(by.A, dW, part), dA = part * by.A;
    const Exponential half = exponential(noisy(continuous.A, W, part), &dN);
    Exponential Phi = exponential(part * continuous.A, &dA);
    MatrixXd Q = Phi.value * half.value.topRightCorner(n, n);
    out.Q = Phi.derivative * half.value.topRightCorner(n, n) +
            Phi.value * half.derivative.topRightCorner(n, n);
    for (int i = 0; i < halvings; ++i) {
      const MatrixXd moved = Phi.derivative * Q * Phi.value.transpose();
      out.Q += (Phi.value * out.Q * Phi.value.transpose() + moved + moved.transpose()).eval();
      Q += (Phi.value * Q * Phi.value.transpose()).eval();
      Phi.derivative = (Phi.derivative * Phi.value + Phi.value * Phi.derivative).eval();
      Phi.value = (Phi.value * Phi.value).eval();
    }
    out.Q = 0.5 * (out.Q + out.Q.transpose()).eval();
    out.G = MatrixXd::Zero(n, n);
    out.S = MatrixXd::Zero(n, continuous.outputs());
  }
  return out;
}

MatrixXd with_next_sample(const MatrixXd& u) {
  const Index nu = u.rows(), N = u.cols();
  MatrixXd out(2 * nu, N);
  out.topRows(nu) = u;
  if (N == 0) return out;
  out.bottomRows(nu).leftCols(N - 1) = u.rightCols(N - 1);
  out.bottomRows(nu).col(N - 1) = u.col(N - 1);
  return out;
}

}  // namespace identikal
