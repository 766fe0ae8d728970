// Where is a likelihood largest whose start may be far away? A trust region on the sum of squares.
#pragma once

#include "solvers/scoring.h"

namespace identikal {

/// maximise L(x) with lower <= x <= upper where L = -n/2 log S(x) + constant, S a sum of squares of n
/// samples whose Jacobian makes the information, as the likelihood of a simulation is once its noise
/// is profiled out. Steps minimise the quadratic of S, not of L, within
///   sum_i (D_i step_i)^2 <= radius^2,  D_i^2 the largest that S's curvature by x_i has been,
/// and the radius follows from how much of the reduction that was promised comes. Unlike scoring it
/// leaves a start many decades off, and passes narrow curved valleys; beside the maximum scoring is as
/// good and says more.
/// Converged when the increase still expected is below options.decrement_tolerance.
/// Source: Moré (1978), "The Levenberg-Marquardt algorithm: implementation and theory".
///
/// Example:
///
///     const Solution near = maximise_from_afar(profiled, start, 35.0, {.max_iterations = 500});
///     const Solution best = maximise(profiled, near.x);
///
/// @param samples  n
/// @throws std::invalid_argument as maximise()
Solution maximise_from_afar(const LikelihoodProblem& problem, const Eigen::VectorXd& start,
                            double samples, const SolverOptions& options = {});

}  // namespace identikal
