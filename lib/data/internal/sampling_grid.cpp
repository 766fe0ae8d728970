#include "lib/data/internal/sampling_grid.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <vector>

#include "lib/base/constants.h"

namespace identikal {

double median_step(const double* first, const double* last) {
  std::vector<double> steps;
  for (const double* t = first; t + 1 < last; ++t) {
    if (t[1] > t[0]) steps.push_back(t[1] - t[0]);
  }
  if (steps.empty()) return 0.0;
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  if (steps.size() % 2 == 1) return *middle;
  return 0.5 * (*middle + *std::max_element(steps.begin(), middle));
}

bool on_some_of_grid(const double* first, const double* last, double step) {
  constexpr double kTolerance = 0.01, kMost = 1e6;
  long common = 0;
  for (const double* t = first; t + 1 < last; ++t) {
    const double steps = (t[1] - t[0]) / step, whole = std::round(steps);
    if (!(whole >= 1.0 && whole < kMost && std::abs(steps - whole) <= kTolerance)) return false;
    common = std::gcd(common, static_cast<long>(whole));
  }
  return common == 1;
}

double grid_of(const double* first, const double* last) {
  constexpr int kFinest = 20;
  double shortest = kInfinity;
  for (const double* t = first; t + 1 < last; ++t) shortest = std::min(shortest, t[1] - t[0]);
  for (int parts = 1; parts <= kFinest; ++parts) {
    if (on_some_of_grid(first, last, shortest / parts)) return shortest / parts;
  }
  return 0.0;
}

}  // namespace identikal
