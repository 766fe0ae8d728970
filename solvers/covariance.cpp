#include "solvers/covariance.h"

#include <Eigen/Eigenvalues>

namespace identikal {

std::optional<Eigen::MatrixXd> scaled_inverse(const Eigen::Ref<const Eigen::MatrixXd>& information,
                                              double tolerance) {
  if (information.size() == 0) return Eigen::MatrixXd(information);
  if (!information.allFinite() || information.diagonal().minCoeff() <= 0.0) return std::nullopt;
  const Eigen::VectorXd scale = information.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scale.asDiagonal() * information *
                                                             scale.asDiagonal());
  if (eigen.eigenvalues().minCoeff() <= tolerance * eigen.eigenvalues().maxCoeff()) {
    return std::nullopt;
  }
  const Eigen::MatrixXd half = scale.asDiagonal() * eigen.eigenvectors() *
                               eigen.eigenvalues().cwiseSqrt().cwiseInverse().asDiagonal();
  return half * half.transpose();
}

std::optional<Eigen::MatrixXd> observed_information(
    const std::function<bool(const Eigen::VectorXd& x, Eigen::VectorXd& gradient)>& gradient,
    const Eigen::VectorXd& x, const Eigen::VectorXd& step) {
  const Eigen::Index n = x.size();
  Eigen::MatrixXd H(n, n);
  Eigen::VectorXd above, below;
  for (Eigen::Index i = 0; i < n; ++i) {
    const Eigen::VectorXd h = step[i] * Eigen::VectorXd::Unit(n, i);
    if (!gradient(x + h, above) || !gradient(x - h, below)) return std::nullopt;
    H.col(i) = (below - above) / (2.0 * step[i]);
  }
  return 0.5 * (H + H.transpose());
}

}  // namespace identikal
