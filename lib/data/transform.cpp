#include "lib/data/transform.h"

#include <cmath>
#include <numbers>

namespace identikal {

double transformed(Transform transform, double y) {
  if (transform == Transform::none) return y;
  return transform == Transform::logarithm ? std::log(y) : std::log10(y);
}

double before_transform(Transform transform, double z) {
  if (transform == Transform::none) return z;
  return transform == Transform::logarithm ? std::exp(z) : std::pow(10.0, z);
}

double log_slope(Transform transform, double z) {
  constexpr double kBase = std::numbers::ln10;
  if (transform == Transform::none) return 0.0;
  return transform == Transform::logarithm ? -z : -kBase * z - std::log(kBase);
}

}  // namespace identikal
