// Which solver for which problem? One overload per kind of problem.
#pragma once

#include "solvers/problem.h"

namespace identikal {

/// Ceres, trust region (Levenberg-Marquardt), dense QR, Jacobian columns scaled.
/// @throws std::invalid_argument when shapes disagree or the start lies outside the box.
Solution solve(const LeastSquares& problem, const Eigen::VectorXd& start,
               const SolverOptions& options = {});

/// NLopt, L-BFGS with bounds.
/// @throws std::invalid_argument when shapes disagree or the start lies outside the box.
Solution solve(const Minimization& problem, const Eigen::VectorXd& start,
               const SolverOptions& options = {});

}  // namespace identikal
