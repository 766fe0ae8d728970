// Where is a likelihood largest whose start may be far away? A trust region on the sum of squares.
#pragma once

#include "solvers/scoring.h"

namespace identikal {

/// maximise L(x) with lower <= x <= upper where L = -n/2 log S(x) + constant, S a sum of squares of
/// n samples whose Jacobian makes the information, as the likelihood of a simulation is once its
/// noise is profiled out. Steps minimise the quadratic of S, not of L, within
///   sum_i (D_i step_i)^2 <= radius^2,  D_i^2 the largest that S's curvature by x_i has been,
/// and the radius follows from how much of the reduction that was promised comes. Unlike scoring it
/// leaves a start many decades off, and passes narrow curved valleys; beside the maximum scoring is
/// as good and says more. Converged when the increase still expected of a whole step is below
/// options.decrement_tolerance; of the options it knows besides max_iterations, of all together,
/// and progress. Where a coordinate has lost all influence meanwhile, once more with a tenth of the
/// first radius, and with ten times it: the best of them.
/// Source: Moré (1978), "The Levenberg-Marquardt algorithm: implementation and theory".
///
/// Example:
///
///     const Solution three = maximise_from_afar({[](const auto& x, double& L, auto* g, auto* J) {
///       const double e = x[0] - 3.0, variance = 0.5 * (e * e + 1.0);  // residuals e and 1
///       if (g && J) *g = Eigen::VectorXd{{-e / variance}}, *J = Eigen::MatrixXd{{1.0 / variance}};
///       return L = -std::log(variance), true;
///     }, Eigen::VectorXd{{-9e9}}, Eigen::VectorXd{{9e9}}}, Eigen::VectorXd{{-1e9}}, 2.0);
///
/// @param samples  n
/// @throws std::invalid_argument as maximise()
Solution maximise_from_afar(const LikelihoodProblem& problem, const Eigen::VectorXd& start,
                            double samples, const SolverOptions& options = {});

/// The same where the noise is known, L = -S/2 and a constant: steps minimise the quadratic of L.
///
/// Example:
///
///     const Solution three = maximise_of_known_noise({[](const auto& x, double& L, auto* g, auto* J) {
///       if (g && J) *g = Eigen::VectorXd{{3.0 - x[0]}}, *J = Eigen::MatrixXd{{1.0}};
///       return L = -0.5 * (x[0] - 3.0) * (x[0] - 3.0), true;
///     }, Eigen::VectorXd{{-9e9}}, Eigen::VectorXd{{9e9}}}, Eigen::VectorXd{{-1e9}});
///
/// @throws std::invalid_argument as maximise()
Solution maximise_of_known_noise(const LikelihoodProblem& problem, const Eigen::VectorXd& start,
                                 const SolverOptions& options = {});

}  // namespace identikal
