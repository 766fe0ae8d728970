// How is a number written that is not there?
#pragma once

#include <limits>

namespace identikal {

/// "Absent"; null in JSON.
inline constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

}  // namespace identikal
