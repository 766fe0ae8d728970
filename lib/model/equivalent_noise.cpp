#include "lib/model/equivalent_noise.h"

#include <stdexcept>

#include <Eigen/LU>

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXd;

std::optional<StateSpace> colour_in_measurement(const StateSpace& shaped, Index filter) {
  const Index n = shaped.states() - filter;
  if (filter < 1 || n < 1 || !shaped.A.topRightCorner(filter, n).isZero(0.0) ||
      !shaped.B.topRows(filter).isZero(0.0)) {
    throw std::invalid_argument("colour_in_measurement: no filter in front of the process noise");
  }
  const MatrixXd Af = shaped.A.topLeftCorner(filter, filter), A = shaped.A.bottomRightCorner(n, n),
                 coupling = shaped.A.bottomLeftCorner(n, filter);
  // vec(X Af - A X) = (Af' x I - I x A) vec X.
  MatrixXd operation = MatrixXd::Zero(n * filter, n * filter);
  for (Index i = 0; i < filter; ++i) {
    for (Index j = 0; j < filter; ++j) {
      operation.block(i * n, j * n, n, n).diagonal().array() += Af(j, i);
    }
    operation.block(i * n, i * n, n, n) -= A;
  }
  constexpr double kCommonPole = 1e-12;
  const Eigen::PartialPivLU<MatrixXd> factor(operation);
  if (!(factor.rcond() > kCommonPole)) return std::nullopt;
  const MatrixXd X = factor.solve(coupling.reshaped()).reshaped(n, filter);
  StateSpace out = shaped;
  out.A.bottomLeftCorner(n, filter).setZero();
  out.G.bottomRows(n) -= X * shaped.G.topRows(filter);
  out.C.leftCols(filter) += shaped.C.rightCols(n) * X;
  return out;
}

}  // namespace identikal
