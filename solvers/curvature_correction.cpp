#include "solvers/curvature_correction.h"

#include <cmath>

#include <Eigen/Cholesky>

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

void CurvatureCorrection::learn(const VectorXd& moved, const VectorXd& fallen,
                                const MatrixXd& information) {
  const VectorXd r = fallen - (information + E_) * moved;
  const double curvature = r.dot(moved), size = moved.dot(information * moved);
  if (std::abs(curvature) > 1e-8 * size) E_ += r * r.transpose() / curvature;
}

void CurvatureCorrection::scale(const VectorXd& ratio) {
  E_ = ratio.asDiagonal() * E_ * ratio.asDiagonal();
}

std::optional<MatrixXd> CurvatureCorrection::apply(const MatrixXd& information,
                                                   const std::vector<Index>& free) const {
  const MatrixXd corrected = information + E_;
  const auto m = static_cast<Index>(free.size());
  MatrixXd J(m, m), B(m, m);
  // Not the root of a product: with noise of 1e84 that is zero.
  const VectorXd root = information.diagonal().cwiseMax(0.0).cwiseSqrt();
  for (Index i = 0; i < m; ++i) {
    for (Index j = 0; j < m; ++j) {
      const Index ii = free[i], jj = free[j];
      const double scale = root[ii] * root[jj];
      if (!(scale > 0.0)) return std::nullopt;
      J(i, j) = information(ii, jj) / scale;
      B(i, j) = corrected(ii, jj) / scale;
    }
  }
  const Eigen::LLT<MatrixXd> above(B - 0.1 * J), below(1000.0 * J - B);
  const bool trusted = above.info() == Eigen::Success && below.info() == Eigen::Success;
  return trusted ? std::optional<MatrixXd>(corrected) : std::nullopt;
}

}  // namespace identikal
