// How much side force does an axle give at a slip angle?
#pragma once

#include <cmath>
#include <optional>
#include <string_view>

namespace identikal {

/// How an axle's side force grows with its slip angle; the equations stand at force_share().
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

/// @param z  >= 0
ForceShare force_share(TyreCurve curve, double z, const CurveShape& shape);

/// Side force of an axle and its derivatives.
struct AxleForce {
  double value = 0.0;  ///< [N]
  double by_slip = 0.0, by_stiffness = 0.0, by_softening = 0.0, by_shape = 0.0, by_curvature = 0.0;
  double by_compliance = 0.0;
};

/// One axle. The linear curve reads its stiffness and compliance only.
///
/// With a compliance kappa [rad/N] of steering and suspension the side force turns the wheels out of
/// the turn, by the aligning torque of pneumatic and mechanical trail n: kappa = n / (torsional
/// stiffness about the kingpins). The tyre then slips by less than the axle, alpha_tyre = alpha +
/// kappa F (Milliken & Milliken 1995, chapter 23), and F is where
///   F = F(alpha + kappa F).
/// Of the linear tyre that is F = -C/(1 + kappa C) alpha, an axle that is softer and nothing else:
/// whatever the drive, C and a constant kappa appear together only, in C/(1 + kappa C), and no
/// recording tells them apart. Forces that follow the slip over a relaxation length follow this F,
/// and nothing changes. Where the tyre bends, the compliance straightens its curve, and there alone
/// the two differ: by their shape.
template <typename T = double>
struct Axle {
  T stiffness = T(0.0);                     ///< C, both wheels together [N/rad], > 0
  T softening = T(0.0);                     ///< 1/(largest force)^2 [1/N^2], >= 0
  T shape = T(CurveShape().shape);          ///< c of the magic formula
  T curvature = T(CurveShape().curvature);  ///< e of the magic formula
  TyreCurve curve = TyreCurve::linear;
  T compliance = T(0.0);  ///< kappa [rad/N], >= 0

  /// Of the axle at small slip, C/(1 + kappa C) [N/rad].
  T effective_stiffness() const { return stiffness / (T(1.0) + compliance * stiffness); }
};

/// An axle with what its curve needs at every instant computed once.
///
/// Example:
///
///     const double softening = 1.0 / (6e3 * 6e3);  // of a largest force of 6 kN
///     const Axle<> front{.stiffness = 88e3, .softening = softening, .curve = TyreCurve::tanh};
///     const double force = AxleCurve(front).force(-0.035);  // [N] at 2 degrees to the right
class AxleCurve {
 public:
  explicit AxleCurve(const Axle<>& axle)
      : axle_(axle), root_(std::sqrt(axle.softening)), largest_(1.0 / root_) {}

  const Axle<>& axle() const { return axle_; }

  /// Side force [N] at a slip angle [rad], both positive to the left.
  double force(double slip) const {
    if (axle_.compliance > 0.0) return of_tyre(slip + axle_.compliance * compliant_force(slip));
    return of_tyre(slip);
  }

  /// The same with its derivatives.
  AxleForce force_and_jacobian(double slip) const {
    if (!(axle_.compliance > 0.0)) {
      AxleForce out = of_tyre_with_jacobian(slip);
      out.by_compliance = out.by_slip * out.value;
      return out;
    }
    const double force = compliant_force(slip);
    AxleForce out = of_tyre_with_jacobian(slip + axle_.compliance * force);
    const double share = 1.0 / (1.0 - axle_.compliance * out.by_slip);
    out.by_compliance = out.by_slip * out.value;
    for (double* each : {&out.by_slip, &out.by_stiffness, &out.by_softening, &out.by_shape,
                         &out.by_curvature, &out.by_compliance}) {
      *each *= share;
    }
    return out;
  }

 private:
  static constexpr double kSeriesOfTanh = 0.01;  // of x^2; below it force_share() has a series

  /// F where F = F(slip + compliance F).
  double compliant_force(double slip) const;

  double of_tyre(double slip) const {
    const double L = -axle_.stiffness * slip;
    if (axle_.curve == TyreCurve::linear) return L;
    if (axle_.curve == TyreCurve::tanh) {
      const double x = L * root_;
      if (x * x >= kSeriesOfTanh) return largest_ * fast_tanh(x);
    }
    return L * share(L).value;
  }

  AxleForce of_tyre_with_jacobian(double slip) const {
    const double L = -axle_.stiffness * slip;
    if (axle_.curve == TyreCurve::linear) return {L, -axle_.stiffness, -slip};
    if (axle_.curve == TyreCurve::tanh) {
      const double x = L * root_;
      if (x * x >= kSeriesOfTanh) {
        const double t = fast_tanh(x), value = largest_ * t, by_L = 1.0 - t * t;
        return {value, -axle_.stiffness * by_L, -slip * by_L,
                0.5 * largest_ * largest_ * (L * by_L - value)};
      }
    }
    const ForceShare at = share(L);
    const double by_L = at.value + 2.0 * axle_.softening * L * L * at.by_z;
    return {L * at.value,        -axle_.stiffness * by_L, -slip * by_L,
            L * L * L * at.by_z, L * at.by_shape,         L * at.by_curvature};
  }

  /// tanh for |x| >= 0.1, by one exponential: half the time of the library's.
  static double fast_tanh(double x) {
    const double decay = std::exp(-2.0 * std::abs(x));
    return std::copysign((1.0 - decay) / (1.0 + decay), x);
  }
  ForceShare share(double L) const {
    return force_share(axle_.curve, axle_.softening * L * L, {axle_.shape, axle_.curvature});
  }

  Axle<> axle_;
  double root_, largest_;
};

}  // namespace identikal
