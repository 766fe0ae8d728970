#include "lib/filter/steady_state.h"

#include <stdexcept>

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

std::optional<SteadyState> steady_state(const StateSpace& model) {
  SteadyFilter<Eigen::Dynamic, Eigen::Dynamic> filter;
  if (!filter.solve(model)) return std::nullopt;
  return SteadyState{filter.P, filter.K, filter.Sigma};
}

}  // namespace identikal
