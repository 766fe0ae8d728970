// Where is a sum of squares least when every residual depends on few of very many unknowns?
#pragma once

#include <functional>
#include <vector>

#include <Eigen/Core>

#include "solvers/problem.h"

namespace identikal {

/// minimise 1/2 sum_g ||r_g(x)||^2 with lower <= x <= upper. x is cut into blocks; every
/// group of residuals depends on a few of them.
struct SparseLeastSquares {
  struct Group {
    std::vector<Eigen::Index> blocks;
    Eigen::Index residuals = 1;
  };
  std::vector<Eigen::Index> block_sizes;  ///< in the order of x
  std::vector<Group> groups;
  /// r, group after group, and when J is not null its derivatives: group after group, within a
  /// group block after block, each residuals x block size, row-major. Both come in the right size.
  /// false = undefined at x, back off.
  std::function<bool(const Eigen::VectorXd& x, Eigen::VectorXd& r, std::vector<double>* J)>
      evaluate;
  Eigen::VectorXd lower, upper;  ///< +-infinity = free
};

/// Levenberg-Marquardt on sparse normal equations (Ceres' SPARSE_NORMAL_CHOLESKY on
/// SuiteSparse, on Eigen's sparse Cholesky where Ceres was built without it).
/// summary.objective is the sum. Converged when options.function_tolerance or parameter_tolerance
/// is met.
///
/// Example:
///
///     const Solution ends = solve(SparseLeastSquares{{1, 1}, {{{0}}, {{0, 1}}},
///       [](const auto& x, auto& r, auto* J) {  // x_1 = 1 and x_2 - x_1 = 2, each with an error
///         if (J) *J = {1.0, -1.0, 1.0};
///         return r = Eigen::Vector2d{x[0] - 1.0, x[1] - x[0] - 2.0}, true;
///     }, Eigen::Vector2d{-9.0, -9.0}, Eigen::Vector2d{9.0, 9.0}}, Eigen::Vector2d{0.0, 0.0});
///
/// @throws std::invalid_argument when sizes disagree or the start lies outside the bounds
Solution solve(const SparseLeastSquares& problem, const Eigen::VectorXd& start,
               const SolverOptions& options = {});

}  // namespace identikal
