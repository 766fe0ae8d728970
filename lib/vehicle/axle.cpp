#include "lib/vehicle/axle.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace identikal {
namespace {

constexpr std::array<std::pair<TyreCurve, std::string_view>, 4> kCurves = {
    {{TyreCurve::linear, "linear"},
     {TyreCurve::tanh, "tanh"},
     {TyreCurve::fiala, "fiala"},
     {TyreCurve::magic_formula, "magic-formula"}}};

struct ValueAndSlope {
  double value, slope;
};

/// atan(sqrt(w)) / sqrt(w) and its derivative with respect to w: smooth at 0.
ValueAndSlope atan_share(double w) {
  if (w < 0.01) {  // seven terms leave less than 1e-14
    double value = 0.0, slope = 0.0;
    for (int k = 7; k >= 0; --k) {
      slope = slope * w + value;
      value = value * w + (k % 2 == 0 ? 1.0 : -1.0) / (2.0 * k + 1.0);
    }
    return {value, slope};
  }
  const double x = std::sqrt(w), value = std::atan(x) / x;
  return {value, (1.0 / (1.0 + w) - value) / (2.0 * w)};
}

/// sin(sqrt(w)) / sqrt(w) and its derivative with respect to w: smooth at 0.
ValueAndSlope sin_share(double w) {
  if (w < 0.01) {  // five terms leave less than 1e-17
    double value = 1.0, slope = 0.0, term = 1.0;
    for (int k = 1; k <= 5; ++k) {
      const double factor = -1.0 / ((2.0 * k) * (2.0 * k + 1.0));
      slope += k * term * factor;
      term *= factor * w;
      value += term;
    }
    return {value, slope};
  }
  const double x = std::sqrt(w), value = std::sin(x) / x;
  return {value, (std::cos(x) - value) / (2.0 * w)};
}

// With x = sqrt(z) = c y, S the shares above and h = 1 - e (1 - S_atan(y^2)):
//   y - e (y - atan y) = y h,   c atan(y h) = x q,  q = h S_atan(y^2 h^2),
//   sin(x q) / x = q S_sin(z q^2).
ForceShare magic_formula_share(double z, const CurveShape& with) {
  const double c = with.shape, e = with.curvature;
  const double w = z / (c * c), w_z = 1.0 / (c * c), w_c = -2.0 * z / (c * c * c);
  const ValueAndSlope inner = atan_share(w);
  const double h = 1.0 - e * (1.0 - inner.value);
  const double h_w = e * inner.slope, h_e = inner.value - 1.0;
  const ValueAndSlope outer = atan_share(w * h * h);
  const double q = h * outer.value;
  const double q_h = outer.value + 2.0 * w * h * h * outer.slope;
  const double q_w = q_h * h_w + h * h * h * outer.slope, q_e = q_h * h_e;
  const ValueAndSlope sine = sin_share(z * q * q);
  const double by_q = sine.value + 2.0 * z * q * q * sine.slope;
  return {q * sine.value, by_q * q_w * w_z + q * q * q * sine.slope, by_q * q_w * w_c, by_q * q_e};
}

constexpr double kSeriesOfTanh = 0.01;  // of z; six terms leave less than 1e-14 up to here

ForceShare tanh_share(double z) {
  if (z < kSeriesOfTanh) {
    constexpr double c1 = -1.0 / 3.0, c2 = 2.0 / 15.0, c3 = -17.0 / 315.0, c4 = 62.0 / 2835.0,
                     c5 = -1382.0 / 155925.0;
    return {1.0 + z * (c1 + z * (c2 + z * (c3 + z * (c4 + z * c5)))),
            c1 + z * (2.0 * c2 + z * (3.0 * c3 + z * (4.0 * c4 + z * 5.0 * c5)))};
  }
  const double x = std::sqrt(z), t = std::tanh(x), share = t / x;
  return {share, (1.0 - t * t - share) / (2.0 * z)};
}

ForceShare fiala_share(double z) {
  // The slope by z is infinite at 0; what it is multiplied by there is zero.
  if (!(z > 0.0)) return {};
  const double x = std::sqrt(z);
  if (x < 3.0) return {1.0 - x / 3.0 + z / 27.0, 1.0 / 27.0 - 1.0 / (6.0 * x)};
  return {1.0 / x, -0.5 / (x * z)};
}

}  // namespace

// Newton's method between the force of a stiff steering and zero, where the excess of F over
// F(slip + compliance F) changes its sign.
double AxleCurve::compliant_force(double slip) const {
  constexpr int kMostSteps = 60;
  constexpr double kExact = 1e-15;
  if (axle_.curve == TyreCurve::linear) return -axle_.effective_stiffness() * slip;
  double low = std::min(0.0, of_tyre(slip)), high = std::max(0.0, of_tyre(slip));
  // Past its peak the tyre gives more than it does at first.
  if (axle_.curve == TyreCurve::magic_formula)
    (slip < 0.0 ? high : low) = std::copysign(largest_, -slip);
  double force = of_tyre(slip) / (1.0 - axle_.compliance * of_tyre_with_jacobian(0.0).by_slip);
  for (int i = 0; i < kMostSteps; ++i) {
    const AxleForce there = of_tyre_with_jacobian(slip + axle_.compliance * force);
    const double excess = force - there.value;
    (excess > 0.0 ? high : low) = force;
    double next = force - excess / (1.0 - axle_.compliance * there.by_slip);
    if (!(next >= low && next <= high)) next = 0.5 * (low + high);
    const double by = std::abs(next - force);
    force = next;
    if (by <= kExact * std::abs(force)) break;
  }
  return force;
}

std::string_view name_of(TyreCurve curve) {
  return std::find_if(kCurves.begin(), kCurves.end(),
                      [curve](const auto& each) { return each.first == curve; })
      ->second;
}

std::optional<TyreCurve> tyre_curve(std::string_view name) {
  for (const auto& [curve, known] : kCurves) {
    if (known == name) return curve;
  }
  return std::nullopt;
}

ForceShare force_share(TyreCurve curve, double z, const CurveShape& shape) {
  switch (curve) {
    case TyreCurve::tanh:
      return tanh_share(z);
    case TyreCurve::fiala:
      return fiala_share(z);
    case TyreCurve::magic_formula:
      return magic_formula_share(z, shape);
    case TyreCurve::linear:
      break;
  }
  return {};
}

}  // namespace identikal
