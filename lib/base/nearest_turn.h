// How far is an angle from the nearest whole turn?
#pragma once

#include <cmath>
#include <numbers>

namespace identikal {

/// The angle less whole turns, from -pi to pi [rad].
///
/// Example:
///
///     const double difference = nearest_turn(3.1 - (-3.1));  // -0.083: short of a turn
inline double nearest_turn(double angle) { return std::remainder(angle, 2.0 * std::numbers::pi); }

}  // namespace identikal
