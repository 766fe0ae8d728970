// Where is the likelihood largest? Fisher scoring with a trust region inside a box.
#pragma once

#include <functional>

#include <Eigen/Core>

#include "solvers/problem.h"

namespace identikal {

/// maximise L(x) with lower <= x <= upper, knowing the expected information.
struct LikelihoodProblem {
  /// L and, when the pointers are not null, its gradient (n) and Fisher information (n x n,
  /// positive semidefinite). false = undefined at x, back off.
  std::function<bool(const Eigen::VectorXd& x, double& L, Eigen::VectorXd* gradient,
                     Eigen::MatrixXd* information)>
      evaluate;
  Eigen::VectorXd lower, upper;  ///< n each; +-infinity = free
};

/// Levenberg-Marquardt steps (J + lambda diag J) d = g on the coordinates that the box leaves free,
/// projected into the box, so that a variance of exactly zero is reachable and left again when the
/// gradient says so. For variances the natural coordinate is the right one: with independent
/// samples one full step from any start is the maximum. Converged when g' J^-1 g / 2, the increase
/// still expected, is below options.decrement_tolerance; where steps come no further, or bring nothing
/// any more (a likelihood that rises for ever along what it does not determine), when what is expected
/// of the determined directions is below options.acceptable_decrement; where no step is left at all,
/// coordinates above zero that change nothing any more when they double are left out of that.
/// summary.objective is L. Source: Osborne
/// (1992), "Fisher's method of scoring", Int. Stat. Rev. 60.
///
/// Example:
///
///     const Solution rate = maximise({[](const auto& x, double& L, auto* g, auto* J) {
///       if (g) *g = Eigen::VectorXd{{7.0 / x[0] - 10.0}};
///       if (J) *J = Eigen::MatrixXd{{10.0 / x[0]}};
///       return L = 7.0 * std::log(x[0]) - 10.0 * x[0], true;  // of 7 arrivals in 10 s
///     }, Eigen::VectorXd{{0.1}}, Eigen::VectorXd{{9.0}}}, Eigen::VectorXd{{1.0}});  // 0.7 per s
///
/// @throws std::invalid_argument when shapes disagree or the start lies outside the box.
Solution maximise(const LikelihoodProblem& problem, const Eigen::VectorXd& start,
                  const SolverOptions& options = {});

}  // namespace identikal
