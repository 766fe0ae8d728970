#include "lib/data/row_time.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace identikal {

std::string row_time(const Dataset& data, Eigen::Index row) {
  constexpr int kLeast = 6, kMost = 17;  // digits
  const double time = data.time[row];
  const double steps = data.dt > 0.0 ? std::abs(time) / data.dt : 0.0;
  const int digits = steps > 1.0 ? static_cast<int>(std::ceil(std::log10(steps))) + 1 : kLeast;
  char text[40];
  std::snprintf(text, sizeof text, "%.*g s", std::clamp(digits, kLeast, kMost), time);
  return text;
}

}  // namespace identikal
