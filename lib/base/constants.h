// Numbers that several files name.
#pragma once

#include <limits>

namespace identikal {

inline constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
inline constexpr double kInfinity = std::numeric_limits<double>::infinity();
inline constexpr double kStandardGravity = 9.80665;  ///< [m/s^2]

}  // namespace identikal
