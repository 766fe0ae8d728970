#include "identify/noise/internal/scattered_start.h"

#include <algorithm>
#include <cmath>

namespace identikal {

ParameterSet scattered_start(ParameterSet start, Random& random) {
  for (Parameter& p : start) {
    if (p.fixed) continue;
    if (p.domain == Domain::scalar && p.min > 0.0 && std::isfinite(p.max)) {
      p.value(0, 0) = p.min * std::pow(p.max / p.min, random.uniform());
    } else if (p.domain != Domain::scalar || p.min >= 0.0) {
      // A variance at zero has no size of its own to be scattered about.
      if (p.value.isZero(0.0)) p.value.diagonal().setOnes();
      p.value *= std::pow(10.0, 4.0 * random.uniform() - 2.0);
    } else if (std::isfinite(p.min) && std::isfinite(p.max)) {
      p.value(0, 0) = p.min + (p.max - p.min) * random.uniform();
    } else {
      p.value(0, 0) *= 1.0 + 0.6 * (random.uniform() - 0.5);
    }
    if (p.domain == Domain::scalar) p.value(0, 0) = std::clamp(p.scalar(), p.min, p.max);
  }
  return start;
}

ParameterSet start_nearby(ParameterSet start, Random& random) {
  for (Parameter& p : start) {
    if (p.fixed || p.domain != Domain::scalar) continue;
    const double factor =
        moves_by_logarithm(p) ? std::exp(random.normal()) : 1.0 + 0.6 * (random.uniform() - 0.5);
    p.value(0, 0) = std::clamp(factor * p.scalar(), p.min, p.max);
  }
  return start;
}

}  // namespace identikal
