// How much side force does an axle give at a slip angle?
#pragma once

#include <cmath>
#include <optional>
#include <string_view>
#include <type_traits>

namespace identikal {

enum class TyreCurve { linear, tanh, fiala, magic_formula };

/// "linear", "tanh", "fiala", "magic-formula".
std::string_view name_of(TyreCurve curve);
std::optional<TyreCurve> tyre_curve(std::string_view name);

/// Every curve is the linear force times a share that depends on z = (linear force / largest
/// force)^2 only:  F = L share(z),  L = -C alpha,  z = softening L^2,  softening = 1/(largest
/// force)^2 [1/N^2]. Written in the softening the linear axle is the point 0 of every curve.
///   tanh:           share = tanh(x)/x,  x = sqrt(z)
///   Fiala (1954):   share = 1 - x/3 + x^2/27 up to x = 3, 1/x beyond: a brush that slides from the
///                   rear edge of the contact on
///   magic formula:  F = D sin(c atan(y - e (y - atan y))),  y = L/(c D),  D = largest force
///                   (Pacejka & Bakker 1992; c is their shape factor C, e their curvature E)
struct CurveShape {
  double shape = 1.5;       ///< c of the magic formula, 1 to 2
  double curvature = -0.5;  ///< e of the magic formula, below 1
};

/// The share and its derivatives.
struct ForceShare {
  double value = 1.0;
  double by_z = 0.0;
  double by_shape = 0.0;      ///< magic formula only
  double by_curvature = 0.0;  ///< magic formula only
};

ForceShare magic_formula_share(double z, const CurveShape& shape);

/// @param z  >= 0
template <TyreCurve curve>
ForceShare force_share(double z, const CurveShape& shape) {
  if constexpr (curve == TyreCurve::tanh) {
    if (z < 0.01) {  // six terms of the series leave less than 1e-14 here
      constexpr double c1 = -1.0 / 3.0, c2 = 2.0 / 15.0, c3 = -17.0 / 315.0, c4 = 62.0 / 2835.0,
                       c5 = -1382.0 / 155925.0;
      return {1.0 + z * (c1 + z * (c2 + z * (c3 + z * (c4 + z * c5)))),
              c1 + z * (2.0 * c2 + z * (3.0 * c3 + z * (4.0 * c4 + z * 5.0 * c5)))};
    }
    const double x = std::sqrt(z), t = std::tanh(x), share = t / x;
    return {share, (1.0 - t * t - share) / (2.0 * z)};
  } else if constexpr (curve == TyreCurve::fiala) {
    // The slope by z is infinite at 0; what it is multiplied by there is zero.
    if (!(z > 0.0)) return {};
    const double x = std::sqrt(z);
    if (x < 3.0) return {1.0 - x / 3.0 + z / 27.0, 1.0 / 27.0 - 1.0 / (6.0 * x)};
    return {1.0 / x, -0.5 / (x * z)};
  } else if constexpr (curve == TyreCurve::magic_formula) {
    return magic_formula_share(z, shape);
  } else {
    return {};
  }
}

/// One axle. The linear curve does not read the rest.
template <typename T, TyreCurve curve = TyreCurve::linear>
struct Axle {
  T stiffness = T(0.0);                     ///< C, both wheels together [N/rad], > 0
  T softening = T(0.0);                     ///< 1/(largest force)^2 [1/N^2], >= 0
  T shape = T(CurveShape().shape);          ///< c of the magic formula
  T curvature = T(CurveShape().curvature);  ///< e of the magic formula

  /// Side force [N] at a slip angle [rad], both positive to the left.
  [[gnu::always_inline]] T force(const T& slip) const {
    const T linear = -(stiffness * slip);
    if constexpr (curve == TyreCurve::linear) {
      return linear;
    } else if constexpr (std::is_same_v<T, double>) {
      return linear * force_share<curve>(softening * linear * linear, {shape, curvature}).value;
    } else {
      // Partial derivatives, carried over by differences that have the value 0.
      const double L = linear.a, z = softening.a * L * L;
      const ForceShare share = force_share<curve>(z, {shape.a, curvature.a});
      T out = T(L * share.value) + (share.value + 2.0 * z * share.by_z) * (linear - L) +
              (L * L * L * share.by_z) * (softening - softening.a);
      if constexpr (curve == TyreCurve::magic_formula) {
        out = out + (L * share.by_shape) * (shape - shape.a) +
              (L * share.by_curvature) * (curvature - curvature.a);
      }
      return out;
    }
  }
};

}  // namespace identikal
