#include "lib/subspace/internal/basis_changes.h"

#include <Eigen/QR>

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

MatrixXd directions_beside_basis_changes(const MatrixXd& A, const MatrixXd& B, const MatrixXd& C,
                                         Index of_D) {
  const Index n = A.rows(), size = A.size() + B.size() + C.size() + of_D;
  MatrixXd tangents(size, n * n);
  for (Index j = 0; j < n; ++j) {
    for (Index i = 0; i < n; ++i) {
      MatrixXd T = MatrixXd::Zero(n, n);
      T(i, j) = 1.0;
      tangents.col(j * n + i) << (T * A - A * T).reshaped(), (T * B).reshaped(),
          (-C * T).reshaped(), VectorXd::Zero(of_D);
    }
  }
  const Eigen::HouseholderQR<MatrixXd> qr(tangents);
  MatrixXd rest = MatrixXd::Zero(size, size - n * n);
  rest.bottomRows(size - n * n).setIdentity();
  return qr.householderQ() * rest;
}

}  // namespace identikal
