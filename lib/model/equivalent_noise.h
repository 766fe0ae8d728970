// Could the same outputs have their colour in another place?
#pragma once

#include <optional>

#include <Eigen/Core>

#include "lib/model/state_space.h"

namespace identikal {

/// A model with coloured process noise as one with coloured measurement noise, driven by the same
/// white noise, with the very same outputs. Of
///
///   f+ = A_f f + g w,  x+ = A x + B u + G (c f + w),  y = C x + D u + v
///
/// the states x~ = x - X f, where X A_f - A X = G c, obey
///
///   x~+ = A x~ + B u + (G - X g) w,  y = C x~ + D u + (C X f + v):
///
/// the theorem of Matisko (2013), section 5.6, with its Diophantine equation as a Sylvester
/// equation for the states, for any number of outputs and noises. Outputs alone never tell the two
/// apart.
///
/// Example:
///
///     // Of a model whose first two states are those of the filter that colours w:
///     const std::optional<StateSpace> same_outputs = colour_in_measurement(model, 2);
///
/// @param shaped  states [f; x], A = [A_f 0; G c A], G = [g; G]
/// @param filter  number of states f
/// @return nothing when filter and system share a pole, to working precision: the source's
/// condition
///   that the polynomials have no common divisor
/// x0 and P0 stay those of [f; x].
/// @throws std::invalid_argument when A is not of that form, or an input enters the filter
std::optional<StateSpace> colour_in_measurement(const StateSpace& shaped, Eigen::Index filter);

}  // namespace identikal
