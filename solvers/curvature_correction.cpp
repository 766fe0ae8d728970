#include "solvers/curvature_correction.h"

#include <cmath>
#include <utility>

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
  // Not the root of a product: with noise of 1e84 that is zero.
  const VectorXd root = information.diagonal().cwiseMax(0.0).cwiseSqrt();
  MatrixXd corrected = information + E_;
  const auto m = static_cast<Index>(free.size());
  MatrixXd above(m, m), below(m, m);
  for (Index i = 0; i < m; ++i) {
    for (Index j = 0; j < m; ++j) {
      const Index ii = free[i], jj = free[j];
      const double scale = root[ii] * root[jj];
      if (!(scale > 0.0)) return std::nullopt;
      const double before = information(ii, jj) / scale, now = corrected(ii, jj) / scale;
      above(i, j) = now - 0.1 * before;
      below(i, j) = 1000.0 * before - now;
    }
  }
  using InPlace = Eigen::LLT<Eigen::Ref<MatrixXd>>;
  const bool trusted =
      InPlace(above).info() == Eigen::Success && InPlace(below).info() == Eigen::Success;
  return trusted ? std::optional<MatrixXd>(std::move(corrected)) : std::nullopt;
}

}  // namespace identikal
