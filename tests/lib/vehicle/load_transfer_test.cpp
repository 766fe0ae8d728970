// Load that turning moves across the car and a steering that gives: their equations solved here once
// more, by bisection, and what compliance is to a linear tyre.
#include <array>
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "lib/base/constants.h"
#include "lib/vehicle/motion.h"
#include "lib/vehicle/secondary_effects.h"
#include "lib/vehicle/sladka2010_car.h"
#include "lib/vehicle/steady_turn.h"
#include "lib/vehicle/steering_response.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kTransferSpeed = 22.0;  // [m/s]

// tanh tyres of 7 kN and 6 kN, 4 deg/(kN) of compliance: strong.
VehicleParameters<double> leaning_car() {
  VehicleParameters<double> p = sladka2010_car();
  p[kCr] = 110e3;
  p[kSteeringCompliance] = 3e-6;
  p[kDegression] = 0.5;
  p[kFrontLoadTransfer] = 0.08;
  p[kRearLoadTransfer] = 0.06;
  p[kInverseSaturationFront] = 1.0 / std::pow(7e3, 2);
  p[kInverseSaturationRear] = 1.0 / std::pow(6e3, 2);
  return p;
}

double weaving_angle(double t) {
  return 1.9 * std::sin(2.0 * std::numbers::pi * (0.2 + 0.06 * t) * t);
}

DrivenSegment weave(const VectorXd& time) {
  return drive(time, time.unaryExpr([](double t) { return weaving_angle(t); }),
               VectorXd::Constant(time.size(), kTransferSpeed), {.decay_rate = 300.0});
}

/// The root of an increasing function.
template <typename F>
double bisected(double low, double high, const F& excess) {
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (excess(middle) > 0.0 ? high : low) = middle;
  }
  return 0.5 * (low + high);
}

/// Rows r, vy, ay: midpoint rule of 1 ms, forces by bisection within bisection.
MatrixXd leaning_witness(const VehicleParameters<double>& p, const VectorXd& time) {
  const auto tyre = [](double C, double softening, double slip) {
    const double D = 1.0 / std::sqrt(softening);
    return -D * std::tanh(C * slip / D);
  };
  const auto axle = [&](double C, double softening, double compliance, double slip) {
    return bisected(-1e4, 1e4,
                    [&](double F) { return F - tyre(C, softening, slip + compliance * F); });
  };
  const auto stiffness = [&](double C, double transfer, double ay) {
    return C * (1.0 - p[kDegression] * std::min(1.0, std::pow(transfer * ay, 2)));
  };
  struct Rates {
    double vy, r, ay;
  };
  const auto rates = [&](double t, double vy, double r) {
    const double front = (vy + p[kA] * r) / kTransferSpeed - weaving_angle(t) / p[kSteeringRatio],
                 rear = (vy - p[kB] * r) / kTransferSpeed;
    const auto forces = [&](double ay) {
      return std::array<double, 2>{
          axle(stiffness(p[kCf], p[kFrontLoadTransfer], ay), p[kInverseSaturationFront],
               p[kSteeringCompliance], front),
          axle(stiffness(p[kCr], p[kRearLoadTransfer], ay), p[kInverseSaturationRear], 0.0, rear)};
    };
    const double ay = bisected(-15.0, 15.0, [&](double at) {
      const auto [Ff, Fr] = forces(at);
      return at - (Ff + Fr) / p[kMass];
    });
    const auto [Ff, Fr] = forces(ay);
    return Rates{ay - kTransferSpeed * r, (p[kA] * Ff - p[kB] * Fr) / p[kYawInertia], ay};
  };
  MatrixXd out(3, time.size());
  double vy = 0.0, r = 0.0;
  for (Index k = 0; k < time.size(); ++k) {
    out.col(k) << r, vy, rates(time[k], vy, r).ay;
    for (int i = 0; i < 10; ++i) {
      const double t = time[k] + 1e-3 * i;
      const Rates begin = rates(t, vy, r);
      const Rates middle = rates(t + 5e-4, vy + 5e-4 * begin.vy, r + 5e-4 * begin.r);
      vy += 1e-3 * middle.vy;
      r += 1e-3 * middle.r;
    }
  }
  return out;
}

MatrixXd leaned(const SingleTrack<>& car, const DrivenSegment& segment) {
  MatrixXd out(3, segment.rows());
  simulate(car, segment, 0.0, 0.0,
           [&](Index k, const Motion& m, double) { out.col(k) << m.r, m.vy, m.ay; });
  return out;
}

double largest_difference(const MatrixXd& a, const MatrixXd& b) {
  return (a - b).rowwise().norm().cwiseQuotient(b.rowwise().norm()).maxCoeff();
}

TEST(LoadTransfer, AndComplianceAreWhatTheirEquationsSay) {
  const VectorXd time = VectorXd::LinSpaced(401, 0.0, 4.0);
  const VehicleParameters<double> p = leaning_car();
  const MatrixXd own = leaned(car_with(TyreCurve::tanh, p), weave(time));
  const double error = largest_difference(own, leaning_witness(p, time));
  std::printf("largest relative difference %.1e, ay up to %.1f m/s^2\n", error,
              own.row(2).maxCoeff());
  EXPECT_GT(own.row(2).maxCoeff(), 5.0);
  EXPECT_LT(error, 1e-4);  // the steering between samples is Pchip's here and a sine there
  // What both take is not small.
  VehicleParameters<double> without = p;
  without[kDegression] = without[kSteeringCompliance] = 0.0;
  EXPECT_GT(largest_difference(leaned(car_with(TyreCurve::tanh, without), weave(time)), own), 0.1);
}

TEST(LoadTransfer, AndComplianceAreThoseOfTheSecondaryEffects) {
  const VectorXd time = VectorXd::LinSpaced(401, 0.0, 4.0);
  const SingleTrack<> car = car_with(TyreCurve::tanh, leaning_car());
  MatrixXd other(3, time.size());
  simulate_with_effects(car, {}, weave(time), 0.0, 0.0,
                        [&](Index k, const Motion& m, double) { other.col(k) << m.r, m.vy, m.ay; });
  EXPECT_LT(largest_difference(other, leaned(car, weave(time))), 5e-3);
}

// A linear tyre of C behind a compliance kappa is an axle of C/(1 + kappa C), whatever the drive and
// with forces that relax as well: nothing tells one from the other.
TEST(SteeringCompliance, OfALinearTyreIsASofterOne) {
  const VectorXd time = VectorXd::LinSpaced(401, 0.0, 4.0);
  for (const double sigma : {0.0, 0.4}) {
    VehicleParameters<double> p = sladka2010_car();
    p[kRelaxationLength] = sigma;
    p[kSteeringCompliance] = 3e-6;
    const DrivenSegment segment =
        drive(time, time.unaryExpr([](double t) { return weaving_angle(t); }),
              VectorXd::Constant(time.size(), kTransferSpeed), {300.0, sigma});
    VehicleParameters<double> softer = p;
    softer[kSteeringCompliance] = 0.0;
    softer[kCf] = p[kCf] / (1.0 + 3e-6 * p[kCf]);
    EXPECT_LT(
        largest_difference(leaned(linear_car(p), segment), leaned(linear_car(softer), segment)),
        1e-12);
    EXPECT_NEAR(understeer_gradient(linear_car(p)), understeer_gradient(linear_car(softer)), 1e-15);
    EXPECT_NEAR(steering_response(linear_car(p), 20.0).damping,
                steering_response(linear_car(softer), 20.0).damping, 1e-12);
  }
}

// A steady turn of the simulation is that of the closed form.
TEST(LoadTransfer, InASteadyTurn) {
  const SingleTrack<> car = car_with(TyreCurve::tanh, leaning_car());
  const VectorXd time = VectorXd::LinSpaced(1501, 0.0, 15.0);
  const DrivenSegment turn =
      drive(time, VectorXd::Constant(time.size(), 0.5),
            VectorXd::Constant(time.size(), kTransferSpeed), {.decay_rate = 300.0});
  const VectorXd end = leaned(car, turn).rightCols<1>();
  const SteadyTurn closed = steady_turn(car, end[2], kTransferSpeed);
  EXPECT_NEAR(closed.road_wheel_angle * car.steering_ratio, 0.5, 1e-5);
  EXPECT_NEAR(closed.sideslip, end[1] / kTransferSpeed, 1e-6);
}

TEST(LoadTransfer, LeavesWhatTwoWheelsOfDegressiveStiffnessHave) {
  // c(F) = p F - q F^2 of wheels with 4 kN, 1 kN moved.
  const double p = 30.0, q = 2e-3, F = 4000.0, moved = 1000.0;
  const auto c = [&](double load) { return p * load - q * load * load; };
  const double k = q * F / (p - q * F);
  EXPECT_NEAR(left_by_load_transfer(k, moved / F, 1.0).value,
              (c(F - moved) + c(F + moved)) / (2.0 * c(F)), 1e-14);
  // With a wheel in the air no more is taken.
  EXPECT_EQ(left_by_load_transfer(0.3, 0.1, 20.0).value, 0.7);
}

}  // namespace
}  // namespace identikal
