// How is a number written that is not there?
#pragma once

#include <limits>

namespace identikal {

inline constexpr double kNone =
    std::numeric_limits<double>::quiet_NaN();  ///< "absent"; null in JSON

}  // namespace identikal
