#include "lib/model/partial_autocorrelation.h"

#include <cmath>

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

VectorXd polynomial_coefficients(const Eigen::Ref<const VectorXd>& partial, MatrixXd* jacobian) {
  const Index p = partial.size();
  VectorXd phi = VectorXd::Zero(p);
  MatrixXd J = MatrixXd::Zero(p, p);
  for (Index k = 0; k < p; ++k) {
    const VectorXd before = phi.head(k).reverse();
    const MatrixXd moved = J.topRows(k).colwise().reverse();
    phi.head(k) -= partial[k] * before;
    J.topRows(k) -= partial[k] * moved;
    J.col(k).head(k) -= before;
    phi[k] = partial[k];
    J(k, k) = 1.0;
  }
  if (jacobian != nullptr) *jacobian = J;
  return phi;
}

std::optional<VectorXd> partial_autocorrelations(const Eigen::Ref<const VectorXd>& coefficients) {
  VectorXd phi = coefficients, out(phi.size());
  for (Index k = phi.size() - 1; k >= 0; --k) {
    const double last = phi[k];
    if (!(std::abs(last) < 1.0)) return std::nullopt;
    out[k] = last;
    const VectorXd turned = phi.head(k).reverse();
    phi.head(k) = (phi.head(k) + last * turned) / (1.0 - last * last);
  }
  return out;
}

}  // namespace identikal
