// Numbers that several files name.
#pragma once

#include <limits>

namespace identikal {

inline constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
inline constexpr double kInfinity = std::numeric_limits<double>::infinity();

}  // namespace identikal
