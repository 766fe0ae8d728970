// Numbers that several files name.
#pragma once

#include <cmath>
#include <limits>
#include <numbers>

namespace identikal {

inline constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
inline constexpr double kInfinity = std::numeric_limits<double>::infinity();
inline const double kLogTwoPi = std::log(2.0 * std::numbers::pi);      ///< of a normal density
inline constexpr double kDegree = std::numbers::pi / 180.0;            ///< [rad]
inline constexpr double kDegreesPerRadian = 180.0 / std::numbers::pi;  ///< [deg/rad]
inline constexpr double kStandardGravity = 9.80665;                    ///< [m/s^2]

}  // namespace identikal
