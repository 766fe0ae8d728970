// Where is the likelihood largest, when steps by the expected information come no further?
#pragma once

#include "solvers/scoring.h"

namespace identikal {

/// maximise L(x) with lower <= x <= upper by Newton's method on the observed information H, central
/// differences of the gradient g. Beside a maximum where H is nothing like the expected information (a
/// spike of the likelihood at a coefficient of zero under a start of large variance, the end of a
/// ridge) scoring creeps, and this arrives. With H = V diag(h) V', scaled to unit diagonal, a step is
///   d = V diag(|h|)^-1 V' g,  g' |H|^-1 g <= Delta^2,
/// which leaves saddles; it needs 2 n gradients a step, for a dozen unknowns. Converged when all h > 0
/// and g' H^-1 g / 2 is below options.decrement_tolerance, or below options.acceptable_decrement
/// where no step brings more. Of the options max_iterations, max_seconds and progress count besides. Source:
/// Dauphin et al. (2014), "Identifying and attacking the saddle point problem", NIPS 27.
///
/// Example:
///
///     const Solution top = maximise_by_curvature({[](const auto& x, double& L, auto* g, auto*) {
///       if (g) *g = Eigen::VectorXd{{-2.0 * x[0] / (1.0 + x[0] * x[0])}};
///       return L = -std::log(1.0 + x[0] * x[0]), true;  // H < 0 at the start
///     }, Eigen::VectorXd{{-9.0}}, Eigen::VectorXd{{9.0}}}, Eigen::VectorXd{{2.0}});  // 0
///
/// @throws std::invalid_argument when shapes disagree or the start lies outside the box.
Solution maximise_by_curvature(const LikelihoodProblem& problem, const Eigen::VectorXd& start,
                               const SolverOptions& options = {});

}  // namespace identikal
