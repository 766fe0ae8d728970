#include "lib/vehicle/axle.h"

#include <cmath>

#include <gtest/gtest.h>

namespace identikal {
namespace {

constexpr double kStiffness = 8e4, kPeak = 3000.0;

Axle<> axle(TyreCurve curve) {
  Axle<> out;
  out.stiffness = kStiffness;
  out.softening = 1.0 / (kPeak * kPeak);
  out.curve = curve;
  return out;
}

double force(TyreCurve curve, double slip) { return AxleCurve(axle(curve)).force(slip); }

// The curves as their authors write them.
double published_tanh(double slip) { return -kPeak * std::tanh(kStiffness * slip / kPeak); }
double published_fiala(double slip) {
  const double linear = kStiffness * slip;
  if (std::abs(linear) >= 3.0 * kPeak) return -std::copysign(kPeak, slip);
  return -linear + linear * std::abs(linear) / (3.0 * kPeak) -
         std::pow(linear, 3) / (27.0 * kPeak * kPeak);
}
double published_magic_formula(double slip) {
  const double C = CurveShape().shape, E = CurveShape().curvature, D = kPeak;
  const double B = kStiffness / (C * D), x = B * slip;
  return -D * std::sin(C * std::atan(x - E * (x - std::atan(x))));
}

TEST(Axle, FollowsThePublishedCurves) {
  for (const double slip : {-0.3, -0.05, -1e-3, 1e-5, 0.004, 0.02, 0.1, 0.2}) {
    EXPECT_DOUBLE_EQ(force(TyreCurve::linear, slip), -kStiffness * slip);
    EXPECT_NEAR(force(TyreCurve::tanh, slip), published_tanh(slip), 1e-10) << slip;
    EXPECT_NEAR(force(TyreCurve::fiala, slip), published_fiala(slip), 1e-10) << slip;
    EXPECT_NEAR(force(TyreCurve::magic_formula, slip), published_magic_formula(slip), 1e-9) << slip;
  }
}

TEST(Axle, IsLinearWithoutSoftening) {
  for (const TyreCurve curve :
       {TyreCurve::linear, TyreCurve::tanh, TyreCurve::fiala, TyreCurve::magic_formula}) {
    Axle<> stiff = axle(curve);
    stiff.softening = 0.0;
    for (const double slip : {-0.1, 0.0, 0.03}) {
      EXPECT_NEAR(AxleCurve(stiff).force(slip), -kStiffness * slip, 1e-12) << name_of(curve);
    }
  }
  // There dF/d(softening) = (C alpha)^3 / 3 for tanh, and dF/dC = -alpha.
  const double slip = 0.02;
  Axle<> stiff = axle(TyreCurve::tanh);
  stiff.softening = 0.0;
  const AxleForce at_zero = AxleCurve(stiff).force_and_jacobian(slip);
  EXPECT_DOUBLE_EQ(at_zero.by_stiffness, -slip);
  EXPECT_NEAR(at_zero.by_softening / (std::pow(kStiffness * slip, 3) / 3.0), 1.0, 1e-14);
}

// By slip, stiffness, softening, shape and curvature, against central differences.
void expect_derivatives(TyreCurve curve, double tolerance) {
  const double at[] = {0.0, kStiffness, 1.0 / (kPeak * kPeak), 1.4, -0.8};
  const auto with = [&](const double* v) { return AxleCurve({v[1], v[2], v[3], v[4], curve}); };
  for (const double slip : {-0.2, -0.03, 0.001, 0.0037, 0.01, 0.06}) {
    double x[5];
    std::copy(std::begin(at), std::end(at), x);
    x[0] = slip;
    const AxleForce force = with(x).force_and_jacobian(slip);
    EXPECT_DOUBLE_EQ(force.value, with(x).force(slip));
    const double exact[] = {force.by_slip, force.by_stiffness, force.by_softening, force.by_shape,
                            force.by_curvature};
    for (std::size_t i = 0; i < 5; ++i) {
      const double h = 1e-5 * std::abs(x[i]), kept = x[i];
      x[i] = kept + h;
      const double plus = with(x).force(x[0]);
      x[i] = kept - h;
      const double minus = with(x).force(x[0]);
      x[i] = kept;
      const double difference = (plus - minus) / (2.0 * h);
      EXPECT_NEAR(exact[i] * x[i], difference * x[i], tolerance * std::abs(force.value))
          << name_of(curve) << " by " << i << " at " << slip;
    }
  }
}

TEST(Axle, DerivativesAreExact) {
  expect_derivatives(TyreCurve::linear, 1e-9);
  expect_derivatives(TyreCurve::tanh, 1e-8);
  expect_derivatives(TyreCurve::fiala, 1e-8);
  expect_derivatives(TyreCurve::magic_formula, 1e-8);
}

// Value and derivatives do not jump where the series ends.
TEST(Axle, SeriesMeetsTheClosedForm) {
  const CurveShape shape;
  for (const double edge : {0.01, 0.01 * shape.shape * shape.shape}) {
    const ForceShare below = force_share(TyreCurve::magic_formula, edge * (1.0 - 1e-12), shape);
    const ForceShare above = force_share(TyreCurve::magic_formula, edge * (1.0 + 1e-12), shape);
    EXPECT_NEAR(below.value, above.value, 1e-12);
    EXPECT_NEAR(below.by_z, above.by_z, 1e-11);
    EXPECT_NEAR(below.by_shape, above.by_shape, 1e-11);
    EXPECT_NEAR(below.by_curvature, above.by_curvature, 1e-11);
  }
  const ForceShare below = force_share(TyreCurve::tanh, 0.01 - 1e-12, shape);
  const ForceShare above = force_share(TyreCurve::tanh, 0.01, shape);
  EXPECT_NEAR(below.value, above.value, 1e-12);
  EXPECT_NEAR(below.by_z, above.by_z, 1e-11);
}

TEST(Axle, NamesGoBothWays) {
  for (const TyreCurve curve :
       {TyreCurve::linear, TyreCurve::tanh, TyreCurve::fiala, TyreCurve::magic_formula}) {
    EXPECT_EQ(tyre_curve(name_of(curve)), curve);
  }
  EXPECT_FALSE(tyre_curve("Pacejka"));
}

}  // namespace
}  // namespace identikal
