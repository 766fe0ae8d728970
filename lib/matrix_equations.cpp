#include "lib/matrix_equations.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

namespace identikal {

std::optional<Eigen::MatrixXd> solve_discrete_lyapunov(const Eigen::Ref<const Eigen::MatrixXd>& A,
                                                       const Eigen::Ref<const Eigen::MatrixXd>& W) {
  Eigen::MatrixXd P = W, power = A;
  // 2^52 steps: a spectral radius of 1 - 1e-14 has decayed, one of 1 has not.
  for (int k = 0; k < 52; ++k) {
    P += (power * P * power.transpose()).eval();
    power = (power * power).eval();
    const double size = power.cwiseAbs().maxCoeff();
    if (!std::isfinite(size)) return std::nullopt;
    if (size < 1e-30) {
      if (!P.allFinite()) return std::nullopt;
      return P;
    }
  }
  return std::nullopt;
}

std::optional<SteadyState> steady_state(const StateSpace& model, int max_steps) {
  const Eigen::Index n = model.states();
  const Eigen::MatrixXd W = model.G * model.Q * model.G.transpose(), Sw = model.G * model.S;
  const bool stable = solve_discrete_lyapunov(model.A, Eigen::MatrixXd::Zero(n, n)).has_value();
  SteadyState out;
  // From P = 0 an unstable mode that no noise enters would never be corrected.
  out.P = stable ? Eigen::MatrixXd::Zero(n, n).eval() : Eigen::MatrixXd::Identity(n, n).eval();
  for (int step = 0; step < max_steps; ++step) {
    out.Sigma = model.C * out.P * model.C.transpose() + model.R;
    const Eigen::LLT<Eigen::MatrixXd> llt(out.Sigma);
    if (llt.info() != Eigen::Success) return std::nullopt;
    out.K = llt.solve((model.A * out.P * model.C.transpose() + Sw).transpose()).transpose();
    const Eigen::MatrixXd F = model.A - out.K * model.C;
    const Eigen::MatrixXd KS = out.K * Sw.transpose();
    Eigen::MatrixXd next =
        F * out.P * F.transpose() + W - KS - KS.transpose() + out.K * model.R * out.K.transpose();
    next = 0.5 * (next + next.transpose()).eval();
    if (!next.allFinite()) return std::nullopt;
    const double change = (next - out.P).cwiseAbs().maxCoeff();
    out.P = next;
    if (change <= 1e-13 * std::max(next.cwiseAbs().maxCoeff(), 1e-300)) return out;
  }
  return std::nullopt;
}

}  // namespace identikal
