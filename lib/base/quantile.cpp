#include "lib/base/quantile.h"

#include <algorithm>
#include <cstddef>

#include "lib/base/constants.h"

namespace identikal {

double quantile(std::vector<double> values, double p) {
  if (values.empty()) return kNaN;
  const double position = p * static_cast<double>(values.size() - 1);
  const auto whole = static_cast<std::ptrdiff_t>(position);
  const auto below = values.begin() + whole;
  std::nth_element(values.begin(), below, values.end());
  const double part = position - static_cast<double>(whole);
  if (!(part > 0.0)) return *below;
  const double above = *std::min_element(below + 1, values.end());
  return above > *below ? *below + part * (above - *below) : *below;
}

}  // namespace identikal
