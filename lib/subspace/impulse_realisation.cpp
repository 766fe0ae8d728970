#include "lib/subspace/impulse_realisation.h"

#include <algorithm>
#include <stdexcept>

#include <Eigen/SVD>

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

ImpulseRealisation::ImpulseRealisation(const std::vector<MatrixXd>& h) {
  if (h.size() < 3) throw std::invalid_argument("ImpulseRealisation: needs three responses");
  const Index p = h[0].rows(), m = h[0].cols();
  for (const MatrixXd& each : h) {
    if (each.rows() != p || each.cols() != m || each.size() == 0 || !each.allFinite())
      throw std::invalid_argument("ImpulseRealisation: finite responses of one size");
  }
  D_ = h[0];
  // With one lag more for the shifted one.
  const auto lags = static_cast<Index>(h.size()) - 1;
  const Index block_rows = lags / 2, columns = lags - block_rows;
  MatrixXd hankel(block_rows * p, columns * m);
  shifted_.resize(block_rows * p, columns * m);
  for (Index i = 0; i < block_rows; ++i) {
    for (Index j = 0; j < columns; ++j) {
      hankel.block(i * p, j * m, p, m) = h[static_cast<std::size_t>(i + j + 1)];
      shifted_.block(i * p, j * m, p, m) = h[static_cast<std::size_t>(i + j + 2)];
    }
  }
  const Eigen::BDCSVD<MatrixXd> svd(hankel, Eigen::ComputeThinU | Eigen::ComputeThinV);
  values_ = svd.singularValues();
  U_ = svd.matrixU();
  V_ = svd.matrixV();
  most_ = (values_.array() > 1e-12 * values_[0]).count();
}

InnovationForm ImpulseRealisation::model(Index states) const {
  if (states < 1 || states > most_)
    throw std::invalid_argument("ImpulseRealisation::model: from one to most_states()");
  const Index p = D_.rows(), m = D_.cols();
  const VectorXd root = values_.head(states).cwiseSqrt(), inverse = root.cwiseInverse();
  const MatrixXd U = U_.leftCols(states), V = V_.leftCols(states);
  InnovationForm out;
  out.A = inverse.asDiagonal() * (U.transpose() * shifted_ * V) * inverse.asDiagonal();
  out.B = root.asDiagonal() * V.topRows(m).transpose();
  out.C = U.topRows(p) * root.asDiagonal();
  out.D = D_;
  out.K = MatrixXd::Zero(states, p);
  out.sigma = MatrixXd::Zero(p, p);
  return out;
}

}  // namespace identikal
