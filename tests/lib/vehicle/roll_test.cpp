// A body that rolls: its equations integrated here once more, its limits, and what measured roll
// does.
#include <array>
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "lib/base/constants.h"
#include "lib/vehicle/motion.h"
#include "lib/vehicle/secondary_effects.h"
#include "lib/vehicle/sladka2010_car.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kRollingSpeed = 22.0;  // [m/s]

VehicleParameters<double> rolling_car() {
  VehicleParameters<double> p = sladka2010_car();
  p[kRollPerAcceleration] = 0.012;
  p[kRollHeight] = 0.5;
  p[kRollFrequency] = 1.4;
  p[kRollDamping] = 0.3;
  p[kFrontSteerPerRoll] = -0.06;
  p[kRearSteerPerRoll] = 0.03;
  p[kFrontCamberPerRoll] = -8000.0;
  p[kRearCamberPerRoll] = -6000.0;
  return p;
}

double swept_angle(double t) {
  return 0.4 * std::sin(2.0 * std::numbers::pi * (0.2 + 0.115 * t) * t);
}

VectorXd hundredths(double seconds) {
  return VectorXd::LinSpaced(static_cast<Index>(std::lround(100.0 * seconds)) + 1, 0.0, seconds);
}

DrivenSegment driven_at_speed(const VectorXd& time) {
  return drive(time, time.unaryExpr([](double t) { return swept_angle(t); }),
               VectorXd::Constant(time.size(), kRollingSpeed), {.decay_rate = 300.0});
}

/// Rows r, vy, ay, roll, roll rate.
MatrixXd rolled(const VehicleParameters<double>& p, const DrivenSegment& segment) {
  MatrixXd out(5, segment.rows());
  simulate(linear_car(p), segment, 0.0, 0.0, [&](Index k, const Motion& m, double) {
    out.col(k) << m.r, m.vy, m.ay, m.roll, m.roll_rate;
  });
  return out;
}

/// The same by equations of its own, in the velocity of the roll axis and phi'': midpoint rule of
/// 0.1 ms.
MatrixXd witness(const VehicleParameters<double>& p, const VectorXd& time) {
  const double m = p[kMass], w = 2.0 * std::numbers::pi * p[kRollFrequency], h = p[kRollHeight];
  std::array<double, 4> x{};  // vy of the axis, r, phi, phi'
  struct Rates {
    std::array<double, 4> of;
    double ay;
  };
  const auto rates = [&](double t, const std::array<double, 4>& s) {
    const double front =
        -p[kCf] * ((s[0] + p[kA] * s[1]) / kRollingSpeed - swept_angle(t) / p[kSteeringRatio] -
                   p[kFrontSteerPerRoll] * s[2]) +
        p[kFrontCamberPerRoll] * s[2];
    const double rear =
        -p[kCr] * ((s[0] - p[kB] * s[1]) / kRollingSpeed - p[kRearSteerPerRoll] * s[2]) +
        p[kRearCamberPerRoll] * s[2];
    const double force = (front + rear) / m;
    const double roll =
        w * w * (p[kRollPerAcceleration] * force - s[2]) - 2.0 * p[kRollDamping] * w * s[3];
    return Rates{{force - kRollingSpeed * s[1] + h * roll,
                  (p[kA] * front - p[kB] * rear) / p[kYawInertia], s[3], roll},
                 force + kStandardGravity * std::sin(s[2])};
  };
  MatrixXd out(5, time.size());
  constexpr int kSteps = 100;
  constexpr double kStep = 1e-4;
  for (Index k = 0; k < time.size(); ++k) {
    out.col(k) << x[1], x[0], rates(time[k], x).ay, x[2], x[3];
    for (int i = 0; i < kSteps; ++i) {
      const double t = time[k] + kStep * i;
      const Rates begin = rates(t, x);
      std::array<double, 4> half;
      for (int j = 0; j < 4; ++j) half[j] = x[j] + 0.5 * kStep * begin.of[j];
      const Rates middle = rates(t + 0.5 * kStep, half);
      for (int j = 0; j < 4; ++j) x[j] += kStep * middle.of[j];
    }
  }
  return out;
}

VectorXd relative_difference(const MatrixXd& a, const MatrixXd& b) {
  return (a - b).rowwise().norm().cwiseQuotient(b.rowwise().norm());
}

TEST(Roll, IsWhatItsEquationsSay) {
  const VectorXd time = hundredths(10.0);
  const VectorXd error = relative_difference(rolled(rolling_car(), driven_at_speed(time)),
                                             witness(rolling_car(), time));
  std::printf("largest relative difference %.1e\n", error.maxCoeff());
  // The steering between samples is Pchip's here and a sine there.
  EXPECT_LT(error.maxCoeff(), 1e-4);
}

TEST(Roll, AgreesWithTheSecondaryEffects) {
  VehicleParameters<double> p = sladka2010_car();
  p[kRollPerAcceleration] = 0.012;
  p[kRollHeight] = 0.17 * (p[kA] + p[kB]);
  const VectorXd time = hundredths(10.0);
  const MatrixXd exact = rolled(p, driven_at_speed(time));
  const auto with = [&](const SingleTrack<>& car, double gradient, double step) {
    SecondaryEffects effects{};
    effects[kRollGradient] = gradient;
    const DrivenSegment fine =
        drive(time, time.unaryExpr([](double t) { return swept_angle(t); }),
              VectorXd::Constant(time.size(), kRollingSpeed), {.longest_step = step});
    MatrixXd out(5, time.size());
    simulate_with_effects(car, effects, fine, 0.0, 0.0, [&](Index k, const Motion& m, double) {
      out.col(k) << m.r, m.vy, m.ay, m.roll, m.roll_rate;
    });
    return relative_difference(out, exact).maxCoeff();
  };
  // As an effect, and as the car's own.
  EXPECT_LT(with(linear_car(sladka2010_car()), 0.012, 0.005), 2e-3);
  EXPECT_LT(with(linear_car(p), 0.0, 0.005), 2e-3);
  EXPECT_NEAR(with(linear_car(p), 0.0, 0.005) / with(linear_car(p), 0.0, 0.0025), 4.0, 0.6);
  // With roll steer and camber thrust there is the car's own alone.
  SecondaryEffects none{};
  const DrivenSegment segment = driven_at_speed(time);
  const MatrixXd own = rolled(rolling_car(), segment);
  MatrixXd other(5, time.size());
  simulate_with_effects(linear_car(rolling_car()), none, segment, 0.0, 0.0,
                        [&](Index k, const Motion& m, double) {
                          other.col(k) << m.r, m.vy, m.ay, m.roll, m.roll_rate;
                        });
  EXPECT_LT(relative_difference(other, own).maxCoeff(), 6e-3);
}

// The simulated roll angle as a measured one moves the car the same way: exactly but for the rate,
// which comes from a sensor's samples here (its straight lines are 80 ms long).
TEST(Roll, MeasuredRollDoesWhatSimulatedRollDoes) {
  const VectorXd time = hundredths(10.0);
  VehicleParameters<double> p = rolling_car();
  for (const bool rate_counts : {false, true}) {
    p[kRollPerAcceleration] = 0.012;
    if (!rate_counts)
      p[kRollHeight] = 0.0;
    else
      p[kRollHeight] = 0.5;
    const MatrixXd own = rolled(p, driven_at_speed(time));
    p[kRollPerAcceleration] = 0.0;
    DrivenSegment segment = driven_at_speed(time);
    set_roll(segment, time, own.row(3).transpose());
    const VectorXd error = relative_difference(rolled(p, segment), own);
    std::printf("measured roll, height %g m: r %.1e, vy %.1e, ay %.1e, roll rate %.1e\n",
                p[kRollHeight], error[0], error[1], error[2], error[4]);
    EXPECT_LT(error.head(4).maxCoeff(), rate_counts ? 2e-2 : 2e-4);
  }
}

TEST(Roll, OfAnUprightBodyIsNone) {
  VehicleParameters<double> p = rolling_car();
  p[kRollPerAcceleration] = 0.0;
  const VectorXd time = hundredths(5.0);
  const MatrixXd upright = rolled(p, driven_at_speed(time)),
                 plain = rolled(sladka2010_car(), driven_at_speed(time));
  EXPECT_EQ((upright - plain).cwiseAbs().maxCoeff(), 0.0);
}

// Steady cornering: roll is the gradient times the forces, and the accelerometer feels gravity.
TEST(Roll, InSteadyCornering) {
  VehicleParameters<double> p = rolling_car();
  const VectorXd time = hundredths(15.0);
  const DrivenSegment turn =
      drive(time, VectorXd::Constant(time.size(), 0.3),
            VectorXd::Constant(time.size(), kRollingSpeed), {.decay_rate = 300.0});
  const VectorXd end = rolled(p, turn).rightCols<1>();
  const double ay = kRollingSpeed * end[0];
  EXPECT_NEAR(end[3], 0.012 * ay, 1e-6);
  EXPECT_NEAR(end[2], ay + kStandardGravity * std::sin(end[3]), 1e-5);
  EXPECT_NEAR(end[4], 0.0, 1e-6);
}

TEST(SteeringLag, IsThatOfTheSecondaryEffects) {
  const VectorXd time = hundredths(10.0);
  const VectorXd steering = time.unaryExpr([](double t) { return swept_angle(t); });
  const VectorXd vx = VectorXd::Constant(time.size(), kRollingSpeed);
  VehicleParameters<double> p = sladka2010_car();
  p[kLagOfSteering] = 0.06;
  const MatrixXd own = rolled(p, drive(time, steering, vx, {.decay_rate = 300.0}, 0.0, 0.06));
  SecondaryEffects effects{};
  effects[kSteeringLag] = 0.06;
  MatrixXd other(3, time.size());
  simulate_with_effects(linear_car(sladka2010_car()), effects,
                        drive(time, steering, vx, {.longest_step = 0.0025}), 0.0, 0.0,
                        [&](Index k, const Motion& m, double) { other.col(k) << m.r, m.vy, m.ay; });
  EXPECT_LT(relative_difference(other, own.topRows(3)).maxCoeff(), 5e-4);
}

}  // namespace
}  // namespace identikal
