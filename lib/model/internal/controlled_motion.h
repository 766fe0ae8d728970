// Where is the state at the end of an interval, to a tolerance, however stiff its motion?
#pragma once

#include "lib/model/nonlinear_model.h"

namespace identikal {

/// Moves x from sample k to k + 1 by the implicit Runge-Kutta method of Radau, IIA with three stages
/// (order 5, L-stable),
///
///   Z_i = h sum_j a_ij f(x + Z_j),  x(t + h) = x + Z_3,
///
/// in steps whose estimated error, which is of order 3, stays below 0.1 tolerance^(2/3): that of
/// the solution is then below the tolerance. The derivatives are exact for
/// the steps that were taken: the stages' linear equations at the solution.
/// What no step however short follows is not finite.
/// @param inputs    of controlled_nodes()
/// @param jacobian  written when not null
/// Source: Hairer & Wanner (1996), Solving ordinary differential equations II, section IV.8.
void move_controlled(const NonlinearModel& model, ModelMemory& memory, const InputNodes& inputs,
                     Eigen::Index k, Eigen::Ref<Eigen::VectorXd> x, Jacobian* jacobian);

}  // namespace identikal
