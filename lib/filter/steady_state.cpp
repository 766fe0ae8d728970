#include "lib/filter/steady_state.h"

#include <stdexcept>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "lib/base/message.h"
#include "lib/filter/internal/steady_filter.h"

namespace identikal {

std::optional<Eigen::MatrixXd> solve_discrete_lyapunov(const Eigen::Ref<const Eigen::MatrixXd>& A,
                                                       const Eigen::Ref<const Eigen::MatrixXd>& W) {
  if (A.rows() != A.cols() || W.rows() != A.rows() || W.cols() != A.rows()) {
    throw std::invalid_argument(message({"discrete Lyapunov equation: A is ", A.rows(), " x ",
                                         A.cols(), ", W ", W.rows(), " x ", W.cols()}));
  }
  Powers<Eigen::Dynamic> powers;
  if (!powers.compute(A)) return std::nullopt;
  Eigen::MatrixXd P = W;
  powers.sum_forward(P);
  if (!P.allFinite()) return std::nullopt;
  return P;
}

namespace {

// Where w and v are one noise and A - G S R^-1 C forgets, however slowly: P = 0. No recursion settles before that does.
std::optional<SteadyState> of_one_noise(const StateSpace& model) {
  constexpr double kRounding = 1e-9;
  const Eigen::LLT<Eigen::MatrixXd> R(model.R);
  if (R.info() != Eigen::Success) return std::nullopt;
  const Eigen::MatrixXd GS = model.G * model.S, W = model.G * model.Q * model.G.transpose();
  const Eigen::MatrixXd K = R.solve(GS.transpose()).transpose();
  const Eigen::VectorXd deviation = W.diagonal().cwiseMax(0.0).cwiseSqrt();
  const Eigen::ArrayXXd left = (W - K * GS.transpose()).array().abs();
  if (!(left <= kRounding * (deviation * deviation.transpose()).array()).all()) return std::nullopt;
  const Eigen::MatrixXd F = model.A - K * model.C;
  if (!(F.eigenvalues().cwiseAbs().maxCoeff() < 1.0)) return std::nullopt;
  return SteadyState{Eigen::MatrixXd::Zero(F.rows(), F.cols()), K, model.R};
}

}  // namespace

std::optional<SteadyState> steady_state(const StateSpace& model) {
  SteadySolution<Eigen::Dynamic, Eigen::Dynamic> filter;
  if (!filter.solve(model)) return of_one_noise(model);
  return SteadyState{filter.P, filter.K, filter.Sigma};
}

}  // namespace identikal
