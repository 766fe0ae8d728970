// Steps of many unknowns by a triangular root, where that is safe: eigenvectors take fifty times as long.
#pragma once

#include <optional>

#include <Eigen/Cholesky>
#include <Eigen/Core>

namespace identikal {

/// From so many on eigenvectors take longer than most likelihoods.
inline constexpr Eigen::Index kManyUnknowns = 100;

/// M^-1 g of a matrix with unit diagonal or more; nothing where it has few rows, is not positive
/// definite, or is so close to singular that directions without information have to be looked for.
inline std::optional<Eigen::VectorXd> solved_by_root(const Eigen::MatrixXd& M,
                                                     const Eigen::VectorXd& g) {
  constexpr double kSmallestPivot = 1e-5;
  if (M.rows() <= kManyUnknowns) return std::nullopt;
  const Eigen::LLT<Eigen::MatrixXd> root(M);
  if (root.info() != Eigen::Success) return std::nullopt;
  const double pivot = root.matrixLLT().diagonal().cwiseAbs2().minCoeff();
  if (!(pivot > kSmallestPivot)) return std::nullopt;
  return root.solve(g);
}

}  // namespace identikal
