// Which solver for which problem? One overload per kind of problem.
#pragma once

#include "solvers/problem.h"

namespace identikal {

/// Ceres, trust region (Levenberg-Marquardt), dense QR, Jacobian columns scaled.
///
/// Example:
///
///     const Solution slope = solve(LeastSquares{[](const auto& x, auto& r, auto* J) {
///       r = Eigen::Vector3d{x[0] - 1.1, 2.0 * x[0] - 1.9, 3.0 * x[0] - 3.2};
///       if (J) *J = Eigen::Vector3d{1.0, 2.0, 3.0};
///       return true;
///     }, 3, Eigen::VectorXd{{0.0}}, Eigen::VectorXd{{9.0}}}, Eigen::VectorXd{{1.0}});
///
/// @throws std::invalid_argument when shapes disagree or the start lies outside the box.
Solution solve(const LeastSquares& problem, const Eigen::VectorXd& start,
               const SolverOptions& options = {});

/// NLopt, L-BFGS with bounds.
/// @throws std::invalid_argument when shapes disagree or the start lies outside the box.
Solution solve(const Minimization& problem, const Eigen::VectorXd& start,
               const SolverOptions& options = {});

/// NLopt, Sbplx (Rowan's subplex in a box): for an f whose gradient nobody has. `evaluate` is never
/// asked for one; the bounds are finite, and the first steps a part of their distance.
/// @throws std::invalid_argument when shapes disagree or the start lies outside the box.
Solution solve_without_gradient(const Minimization& problem, const Eigen::VectorXd& start,
                                const SolverOptions& options = {});

}  // namespace identikal
