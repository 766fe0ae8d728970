#include "lib/base/random.h"

#include <cmath>
#include <sstream>
#include <stdexcept>

#include <Eigen/Eigenvalues>

namespace identikal {

double Random::uniform() {
  // 53 random bits, moved by half a step so that 0 and 1 never occur.
  return (static_cast<double>(engine_() >> 11) + 0.5) * 0x1.0p-53;
}

double Random::normal() {
  if (has_spare_) {
    has_spare_ = false;
    return spare_;
  }
  double a, b, s;
  do {
    a = 2.0 * uniform() - 1.0;
    b = 2.0 * uniform() - 1.0;
    s = a * a + b * b;
  } while (s >= 1.0 || s == 0.0);
  const double factor = std::sqrt(-2.0 * std::log(s) / s);
  spare_ = b * factor;
  has_spare_ = true;
  return a * factor;
}

Eigen::VectorXd Random::normal(Eigen::Index n) {
  Eigen::VectorXd z(n);
  for (Eigen::Index i = 0; i < n; ++i) z[i] = normal();
  return z;
}

Eigen::MatrixXd semidefinite_factor(const Eigen::Ref<const Eigen::MatrixXd>& M) {
  if (M.size() == 0) return M;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(M);
  const double largest = eigen.eigenvalues().cwiseAbs().maxCoeff();
  if (eigen.eigenvalues().minCoeff() < -1e-9 * largest) {
    std::ostringstream text;
    text << "matrix is not positive semidefinite: eigenvalues " << eigen.eigenvalues().transpose();
    throw std::invalid_argument(text.str());
  }
  return eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal();
}

}  // namespace identikal
