#include <cmath>
#include <stdexcept>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <gtest/gtest.h>

#include "lib/base/dual.h"
#include "lib/vehicle/manoeuvre.h"
#include "lib/vehicle/sensor.h"
#include "lib/vehicle/sladka2010_car.h"
#include "lib/vehicle/steering_response.h"

namespace identikal {
namespace {

using Eigen::VectorXd;

/// Half a unit of the last digit printed.
void expect_printed(double value, double printed, int decimals) {
  EXPECT_NEAR(value, printed, 0.5000001 * std::pow(10.0, -decimals));
}

TEST(SingleTrack, CharacteristicValuesOfTheSladka2010Car) {
  const SingleTrack<> car = linear_car(sladka2010_car());
  expect_printed(understeer_gradient(car), 0.003515, 6);
  // Printed as 1.976 deg/g, which is with g = 9.81 m/s^2; with standard gravity it is 1.975.
  constexpr double kDegrees = 57.295779513082323;
  expect_printed(understeer_gradient(car) * kDegrees * 9.81, 1.976, 3);
  expect_printed(understeer_gradient(car) * kDegrees * kStandardGravity, 1.975, 3);
  expect_printed(3.6 * characteristic_speed(car), 96.2, 1);

  const SteeringResponse<double> at60 = steering_response(car, 60.0 / 3.6);
  expect_printed(at60.yaw_gain, 4.7778, 4);
  expect_printed(at60.sideslip_gain, -0.0763, 4);
  expect_printed(at60.natural_frequency, 8.546, 3);
  expect_printed(at60.damping, 0.8679, 4);
  expect_printed(at60.yaw_lead_time, 0.1075, 4);

  const SteeringResponse<double> at100 = steering_response(car, 100.0 / 3.6);
  expect_printed(at100.yaw_gain, 5.3172, 4);
  expect_printed(at100.sideslip_gain, -0.6605, 4);
  expect_printed(at100.natural_frequency, 6.275, 3);
  expect_printed(at100.damping, 0.7092, 4);
  expect_printed(at100.yaw_lead_time, 0.1791, 4);
}

TEST(SingleTrack, ComplianceOfTheAxlesMakesTheGradient) {
  VehicleParameters<double> p = sladka2010_car();
  p[kCr] = 120000.0;
  const SingleTrack<> car = linear_car(p);
  EXPECT_NEAR(understeer_gradient(car), front_compliance(car) - rear_compliance(car), 1e-15);
  EXPECT_GT(understeer_gradient(car), 0.0);
  p[kCr] = 40000.0;
  const SingleTrack<> loose = linear_car(p);
  EXPECT_LT(understeer_gradient(loose), 0.0);
  // At its critical speed one real pole of an oversteering car reaches zero.
  const Eigen::Matrix2d A = single_track_matrices(loose, characteristic_speed(loose)).A;
  EXPECT_NEAR(A.determinant(), 0.0, 1e-9);
}

TEST(SingleTrack, MatricesHaveTheCharacteristicPolynomial) {
  const SingleTrack<> car = linear_car(sladka2010_car());
  for (const double u : {5.0, 16.7, 40.0}) {
    const SingleTrackMatrices model = single_track_matrices(car, u);
    const SteeringResponse<double> response = steering_response(car, u);
    const double wn = response.natural_frequency;
    EXPECT_NEAR(model.A.determinant(), wn * wn, 1e-9 * wn * wn);
    EXPECT_NEAR(-model.A.trace(), 2.0 * response.damping * wn, 1e-9 * wn);
    const Eigen::Vector2d steady = -model.A.inverse() * model.B;
    EXPECT_NEAR(steady[1], response.yaw_gain, 1e-9);
    EXPECT_NEAR(steady[0] / u, response.sideslip_gain, 1e-9);
    EXPECT_NEAR(u * steady[1], response.ay_gain, 1e-8);
    // The zero of r/delta: r(s)/delta(s) = B2 (s + 1/Tz) / det(s I - A).
    const double zero = model.A(0, 0) - model.A(1, 0) * model.B[0] / model.B[1];
    EXPECT_NEAR(-1.0 / zero, response.yaw_lead_time, 1e-12);
  }
}

// The source prints -(a Cf + b Cr) in row 2, column 1 of (7.4); the moment balance (7.3) of the
// same page has
// -(a Cf - b Cr): sideslip to the left makes both axles push to the right, the rear one turns the
// nose left.
TEST(SingleTrack, FollowsTheMomentBalanceNotThePrintedMatrix) {
  const SingleTrack<> car = linear_car(sladka2010_car());
  const double u = 60.0 / 3.6;
  const double printed = -(car.a * car.front.stiffness + car.b * car.rear.stiffness) / (car.Iz * u);
  const double element = single_track_matrices(car, u).A(1, 0);
  EXPECT_NEAR(element, (-car.a + car.b) * 88107.7 / (car.Iz * u), 1e-12);
  EXPECT_GT(element, 0.0);
  EXPECT_LT(printed, -5.0);
}

struct Final {
  double vy = 0, r = 0, ay = 0;
};

Final drive_constant(const SingleTrack<>& car, double delta_measured, double vx, double seconds,
                     double vy = 0.0, double r = 0.0) {
  const VectorXd time =
      VectorXd::LinSpaced(static_cast<Eigen::Index>(seconds * 100.0) + 1, 0.0, seconds);
  const DrivenSegment segment =
      drive(time, VectorXd::Constant(time.size(), delta_measured),
            VectorXd::Constant(time.size(), vx), {decay_rate_times_speed(car)});
  Final last;
  simulate(car, segment, vy, r, [&](Eigen::Index, const Motion& motion, double) {
    last = {motion.vy, motion.r, motion.ay};
  });
  return last;
}

TEST(SingleTrack, DrivesTheSteadyCircle) {
  const SingleTrack<> car = linear_car(sladka2010_car());
  for (const double u : {4.0, 16.7, 30.0}) {
    const double wheel = 0.3, delta = wheel / 21.0;
    const Final last = drive_constant(car, wheel, u, 10.0);
    const SteeringResponse<double> response = steering_response(car, u);
    EXPECT_NEAR(last.r, response.yaw_gain * delta, 1e-10);
    EXPECT_NEAR(last.ay, response.ay_gain * delta, 1e-9);
    EXPECT_NEAR(last.ay, u * last.r, 1e-9);
    EXPECT_NEAR(last.vy / u, response.sideslip_gain * delta, 1e-10);
    const Eigen::Vector2d steady = steady_state(car, {wheel, u, 1.0 / u});
    EXPECT_NEAR(steady[0], last.vy, 1e-9);
    EXPECT_NEAR(steady[1], last.r, 1e-10);
  }
}

TEST(SingleTrack, SteeringGainAndOffsetActOnTheMeasuredAngle) {
  VehicleParameters<double> p = sladka2010_car();
  p[kSteeringGain] = 1.1;
  p[kSteeringOffset] = 0.05;
  const Final altered = drive_constant(linear_car(p), 0.3, 20.0, 8.0);
  const Final plain = drive_constant(linear_car(sladka2010_car()), 1.1 * 0.35, 20.0, 8.0);
  EXPECT_NEAR(altered.r, plain.r, 1e-12);
}

// Left side of the road up: the car slides to the right unless it steers left; standing on the
// slope an accelerometer feels the road push to the left.
TEST(SingleTrack, BankPullsDownTheSlope) {
  VehicleParameters<double> p = sladka2010_car();
  p[kBank] = 0.03;
  const SingleTrack<> car = linear_car(p);
  const double gravity = kStandardGravity * std::sin(0.03);
  EXPECT_NEAR(drive_constant(car, 0.0, 20.0, 0.01).vy, -0.01 * gravity, 0.05 * 0.01 * gravity);
  // Steady: forces carry the weight component and bend the path, ay = vx r + g sin(bank).
  const Final last = drive_constant(car, 0.0, 20.0, 10.0);
  EXPECT_NEAR(last.ay, 20.0 * last.r + gravity, 1e-10);
  EXPECT_LT(last.r, 0.0);
  const Eigen::Vector2d steady =
      steady_state(car, {.steering = 0.0, .vx = 20.0, .inverse_vx = 0.05});
  EXPECT_NEAR(steady[1], last.r, 1e-10);
}

double measured(const VehicleSensor& sensor, const SingleTrack<>& car, const Motion& motion,
                double vx) {
  return VehicleReading(sensor, car).value(motion, vx);
}

TEST(SingleTrack, SensorsMoveWithTheRigidBody) {
  SingleTrack<> car = linear_car(sladka2010_car());
  car.bias_r = 0.01;
  car.bias_vy = 0.02;
  car.bias_ay = 0.03;
  Motion motion{};
  motion.vy = 0.5;
  motion.r = 0.2;
  motion.ay = 3.0;
  motion.yaw_acceleration = -0.4;
  const double vx = 15.0;
  EXPECT_DOUBLE_EQ(measured({VehicleQuantity::r, 2.0, 1.0}, car, motion, vx), 0.21);
  EXPECT_DOUBLE_EQ(measured({VehicleQuantity::vy, 2.0, 1.0}, car, motion, vx), 0.5 + 0.4 + 0.02);
  EXPECT_DOUBLE_EQ(measured({VehicleQuantity::ay, 2.0, 1.0}, car, motion, vx),
                   3.0 - 0.8 - 0.04 + 0.03);
  EXPECT_DOUBLE_EQ(measured({VehicleQuantity::beta, 2.0, 1.0}, car, motion, vx),
                   std::atan2(0.9, 14.8));
  // The two vector sensors of the source, section 8.3: r follows from their difference.
  const double front = measured({VehicleQuantity::vy, 2.109, -0.027}, car, motion, vx);
  const double rear = measured({VehicleQuantity::vy, -2.760, -0.379}, car, motion, vx);
  EXPECT_NEAR((front - rear) / 4.869, motion.r, 1e-12);
}

TEST(SingleTrack, NamesItsParametersAndQuantities) {
  for (int i = 0; i < kVehicleParameters; ++i) {
    const auto parameter = static_cast<VehicleParameter>(i);
    EXPECT_EQ(vehicle_parameter(name_of(parameter)), parameter);
  }
  EXPECT_EQ(vehicle_parameter("Cx"), std::nullopt);
  EXPECT_EQ(vehicle_quantity("beta"), VehicleQuantity::beta);
  EXPECT_EQ(vehicle_quantity("roll"), std::nullopt);
  EXPECT_TRUE(std::isnan(neutral_vehicle()[kCf]));
  EXPECT_EQ(neutral_vehicle()[kSteeringGain], 1.0);
}

// Constant inputs: the exact answer is the matrix exponential. At walking pace the fastest pole is
// at -100 1/s, where steps of 0.01 s would err by percents.
TEST(Simulation, IsAccurateAtWalkingPace) {
  const SingleTrack<> car = linear_car(sladka2010_car());
  const double u = 1.5, wheel = 2.0;
  const SingleTrackMatrices model = single_track_matrices(car, u);
  const Eigen::EigenSolver<Eigen::Matrix2d> eigen(model.A);
  const Eigen::Vector2d steady = -model.A.inverse() * model.B * (wheel / 21.0);
  const VectorXd time = VectorXd::LinSpaced(51, 0.0, 0.5);
  const DrivenSegment segment = drive(time, VectorXd::Constant(51, wheel),
                                      VectorXd::Constant(51, u), {decay_rate_times_speed(car)});
  EXPECT_GT(segment.intervals.front().steps, 1);
  double worst = 0.0;
  simulate(car, segment, 0.0, 0.0, [&](Eigen::Index k, const Motion& motion, double) {
    const Eigen::Matrix2cd V = eigen.eigenvectors();
    const Eigen::Vector2cd decay = (eigen.eigenvalues() * time[k]).array().exp();
    const Eigen::Matrix2d transition = (V * decay.asDiagonal() * V.inverse()).real();
    const Eigen::Vector2d exact = steady - transition * steady;
    worst = std::max(worst, std::abs(motion.r / steady[1] - exact[1] / steady[1]));
    worst = std::max(worst, std::abs(motion.vy / steady[0] - exact[0] / steady[0]));
  });
  EXPECT_LT(worst, 1e-4);
}

TEST(Simulation, DoesNotDependOnTheSampling) {
  const SingleTrack<> car = linear_car(sladka2010_car());
  const auto run = [&](const VectorXd& time) {
    const VectorXd vx = (14.0 + 2.0 * (0.7 * time.array()).sin()).matrix();
    const DrivenSegment segment =
        drive(time, steering(SevereLaneChange{}, time), vx, {decay_rate_times_speed(car)});
    VectorXd r(time.size());
    simulate(car, segment, 0.1, 0.0,
             [&](Eigen::Index k, const Motion& motion, double) { r[k] = motion.r; });
    return r;
  };
  const VectorXd even = VectorXd::LinSpaced(701, 0.0, 7.0);
  // Every sample the even sampling grid has from 2 s to 5 s, every third one elsewhere.
  std::vector<double> stamps;
  std::vector<Eigen::Index> same;
  for (Eigen::Index k = 0; k < 701; ++k) {
    if (k % 3 != 0 && (k < 200 || k > 500)) continue;
    stamps.push_back(even[k]);
    same.push_back(k);
  }
  const VectorXd uneven =
      Eigen::Map<VectorXd>(stamps.data(), static_cast<Eigen::Index>(stamps.size()));
  const VectorXd r_even = run(even), r_uneven = run(uneven);
  for (std::size_t i = 0; i < same.size(); ++i) {
    EXPECT_NEAR(r_uneven[static_cast<Eigen::Index>(i)], r_even[same[i]], 2e-4);
  }
}

// Derivatives by every parameter and by the initial state against central differences of the same
// simulation, for every curve, with forces that relax and without.
void expect_exact_derivatives(TyreCurve curve, double relaxation_length, double roll_gradient,
                              double tolerance, double degression = 0.0) {
  VehicleParameters<double> p = sladka2010_car();
  p[kCr] = 110000.0;
  p[kSteeringOffset] = 0.01;
  p[kSteeringDelay] = 0.033;
  p[kBiasR] = 0.01;
  p[kBank] = 0.02;
  p[kMountingAngle] = 0.03;
  p[kRelaxationLength] = relaxation_length;
  p[kRollPerAcceleration] = roll_gradient;
  p[kRollHeight] = 0.45;
  p[kRollFrequency] = 1.3;
  p[kFrontSteerPerRoll] = -0.08;
  p[kRearSteerPerRoll] = 0.04;
  p[kFrontCamberPerRoll] = -9000.0;
  p[kRearCamberPerRoll] = -5000.0;
  p[kLagOfSteering] = 0.04;
  p[kCgHeight] = 0.5;
  p[kLoadSensitivity] = 0.7;
  p[kDegression] = degression;
  p[kSteeringCompliance] = degression > 0.0 ? 2e-6 : 0.0;
  p[kFrontLoadTransfer] = 0.08;
  p[kRearLoadTransfer] = 0.06;
  p[kInverseSaturationFront] = 1.0 / std::pow(7000.0, 2);
  p[kInverseSaturationRear] = 1.0 / std::pow(5000.0, 2);
  const VectorXd time = VectorXd::LinSpaced(141, 0.0, 7.0);
  const VectorXd vx = (15.0 + 4.0 * (0.5 * time.array()).cos()).matrix();
  const VectorXd angle = steering(SevereLaneChange{}, time);
  const IntegrationDemand demand{300.0, relaxation_length};
  const std::vector<VehicleSensor> sensors = {{VehicleQuantity::r, 0.0, 0.0},
                                              {VehicleQuantity::vy, 1.5, 0.2, 0.1},
                                              {VehicleQuantity::ay, -0.4, 0.3, -0.1},
                                              {VehicleQuantity::beta, 2.1, -0.3, 0.05}};
  constexpr int kStates = kVehicleParameters, kVariables = kVehicleParameters + 2;
  const auto outputs = [&](const VehicleParameters<double>& q, double vy, double r) {
    std::vector<double> out;
    const DrivenSegment segment =
        drive(time, angle, vx, demand, q[kSteeringDelay], q[kLagOfSteering]);
    const SingleTrack<> car = car_with(curve, q);
    simulate(car, segment, vy, r, [&](Eigen::Index, const Motion& motion, double u) {
      for (const VehicleSensor& sensor : sensors) {
        out.push_back(VehicleReading(sensor, car).value(motion, u));
      }
    });
    return out;
  };
  const DrivenSegment segment =
      drive(time, angle, vx, demand, p[kSteeringDelay], p[kLagOfSteering]);
  const SingleTrack<> car = car_with(curve, p);
  JacobianColumns columns;
  columns.columns = kVariables;
  for (int i = 0; i < kVehicleParameters; ++i) columns.parameter[static_cast<std::size_t>(i)] = i;
  columns.vy = kStates;
  columns.r = kStates + 1;
  std::vector<double> values;
  std::vector<Eigen::RowVectorXd> exact;
  simulate_with_jacobian(
      car, segment, 0.3, 0.1, columns,
      [&](Eigen::Index, const Motion& motion, const MotionJacobian& jacobian, double u) {
        for (const VehicleSensor& sensor : sensors) {
          const VehicleReading reading(sensor, car);
          values.push_back(reading.value(motion, u));
          exact.emplace_back(kVariables);
          reading.jacobian(motion, u, columns, jacobian, exact.back());
        }
      });
  const std::vector<double> plain = outputs(p, 0.3, 0.1);
  for (std::size_t j = 0; j < plain.size(); ++j) EXPECT_DOUBLE_EQ(values[j], plain[j]);
  for (int i = 0; i < kVariables; ++i) {
    // Zero stands for "no relaxation", and is no point to differentiate at.
    if (i == kRelaxationLength && relaxation_length == 0.0) continue;
    if (i == kRollPerAcceleration && roll_gradient == 0.0) continue;
    if ((i == kDegression || i == kSteeringCompliance) && degression == 0.0) continue;
    const auto n = static_cast<std::size_t>(i);
    const double value = i < kStates ? p[n] : i == kStates ? 0.3 : 0.1;
    const double h = value != 0.0 ? 1e-5 * std::abs(value) : 1e-5;
    VehicleParameters<double> up = p, down = p;
    double vy[2] = {0.3, 0.3}, r[2] = {0.1, 0.1};
    if (i < kStates) {
      up[n] += h;
      down[n] -= h;
    } else {
      (i == kStates ? vy : r)[0] += h;
      (i == kStates ? vy : r)[1] -= h;
    }
    const std::vector<double> plus = outputs(up, vy[0], r[0]), minus = outputs(down, vy[1], r[1]);
    double scale = 0.0, worst = 0.0;
    for (std::size_t j = 0; j < exact.size(); ++j) {
      const double difference = (plus[j] - minus[j]) / (2.0 * h);
      scale = std::max(scale, std::abs(difference));
      worst = std::max(worst, std::abs(exact[j][i] - difference));
    }
    EXPECT_LE(worst, tolerance * scale) << name_of(curve) << " variable " << i;
  }
}

TEST(Simulation, CarriesExactDerivativesOfLoadTransferAndCompliance) {
  for (const double relaxation_length : {0.0, 0.4}) {
    for (const double roll : {0.0, 0.012}) {
      for (const TyreCurve curve :
           {TyreCurve::linear, TyreCurve::tanh, TyreCurve::magic_formula, TyreCurve::fiala}) {
        expect_exact_derivatives(curve, relaxation_length, roll,
                                 curve == TyreCurve::fiala ? 1e-4 : 1e-5, 0.4);
      }
    }
  }
}

TEST(Simulation, CarriesExactDerivatives) {
  for (const double relaxation_length : {0.0, 0.4}) {
    for (const double roll : {0.0, 0.012}) {
      expect_exact_derivatives(TyreCurve::linear, relaxation_length, roll, 1e-6);
      expect_exact_derivatives(TyreCurve::tanh, relaxation_length, roll, 1e-6);
      expect_exact_derivatives(TyreCurve::magic_formula, relaxation_length, roll, 1e-6);
      // Its second derivative jumps where the whole contact begins to slide.
      expect_exact_derivatives(TyreCurve::fiala, relaxation_length, roll, 1e-5);
    }
  }
}

// A force that relaxes follows a step of the steering with the time constant sigma / vx: the first
// instant has no force, and a car whose forces relax within a hair is the one without relaxation.
TEST(Simulation, ForcesRelax) {
  VehicleParameters<double> p = sladka2010_car();
  const VectorXd time = VectorXd::LinSpaced(201, 0.0, 2.0);
  const VectorXd vx = VectorXd::Constant(201, 20.0), angle = steering(SevereLaneChange{}, time);
  const auto yaw_rate = [&](double relaxation_length) {
    p[kRelaxationLength] = relaxation_length;
    const auto car = linear_car(p);
    VectorXd out(201);
    simulate(car, drive(time, angle, vx, {decay_rate_times_speed(car), relaxation_length}), 0.0,
             0.0, [&](Eigen::Index k, const Motion& motion, double) { out[k] = motion.r; });
    return out;
  };
  const VectorXd at_once = yaw_rate(0.0);
  // First order in sigma: halving it halves the difference.
  const double far = (yaw_rate(0.02) - at_once).norm(), near = (yaw_rate(0.01) - at_once).norm();
  EXPECT_NEAR(far / near, 2.0, 0.05);
  EXPECT_LT(near, 0.02 * at_once.norm());
}

// Braking loads the front axle: with h = 0.5 m and 4 m/s^2 by 0.5 * 4 / (9.80665 * 1.525).
TEST(Simulation, BrakingShiftsLoad) {
  VehicleParameters<double> p = sladka2010_car();
  p[kCgHeight] = 0.5;
  p[kLoadSensitivity] = 0.8;
  const SingleTrack<> car = linear_car(p);
  const DrivenSegment::Node straight{.steering = 0.1, .vx = 20.0, .inverse_vx = 0.05};
  DrivenSegment::Node braking = straight;
  braking.vx_rate = -4.0;
  const Motion before = motion_at(car, 0.2, 0.1, straight);
  const Motion after = motion_at(car, 0.2, 0.1, braking);
  EXPECT_NEAR(after.force_front / before.force_front, 1.0 + 0.8 * 2.0 / (kStandardGravity * 1.525),
              1e-12);
  EXPECT_NEAR(after.force_rear / before.force_rear, 1.0 - 0.8 * 2.0 / (kStandardGravity * 0.987),
              1e-12);
  // A glitch of the measured speed leaves a tenth of the load on an axle.
  DrivenSegment::Node glitch = straight;
  glitch.vx_rate = 1e4;
  EXPECT_NEAR(motion_at(car, 0.2, 0.1, glitch).force_front / before.force_front, 1.0 - 0.8 * 0.9,
              1e-12);
}

// A delay is the same as steering that comes later.
TEST(Simulation, DelayMovesTheSteering) {
  const VectorXd time = VectorXd::LinSpaced(701, 0.0, 7.0), vx = VectorXd::Constant(701, 16.0);
  const DrivenSegment late = drive(time, steering(SevereLaneChange{}, time), vx, {300.0}, 0.2);
  SevereLaneChange later;
  later.start += 0.2;
  const DrivenSegment moved = drive(time, steering(later, time), vx, {300.0});
  ASSERT_EQ(late.nodes.size(), moved.nodes.size());
  for (std::size_t i = 0; i < late.nodes.size(); ++i) {
    EXPECT_NEAR(late.nodes[i].steering, moved.nodes[i].steering, 1e-9);
  }
}

TEST(Simulation, RefusesWhatCannotBeDriven) {
  const VectorXd time = VectorXd::LinSpaced(5, 0.0, 1.0), zero = VectorXd::Zero(5);
  EXPECT_THROW(drive(time, zero, zero, {100.0}), std::invalid_argument);
  EXPECT_THROW(drive(time, VectorXd::Zero(4), VectorXd::Ones(5), {100.0}), std::invalid_argument);
  EXPECT_THROW(drive(VectorXd::Zero(1), VectorXd::Zero(1), VectorXd::Ones(1), {100.0}),
               std::invalid_argument);
}

TEST(Dual, FollowsTheRulesOfCalculus) {
  using D = Dual<2>;
  const D x(1.3, 0), y(0.7, 1);
  const D f = sqrt(x * x + y) / (2.0 - sin(x)) + tanh(y) - 3.0 * atan2(x, y) + abs(-x) / y;
  const auto value = [](double a, double b) {
    return std::sqrt(a * a + b) / (2.0 - std::sin(a)) + std::tanh(b) - 3.0 * std::atan2(a, b) +
           std::abs(-a) / b;
  };
  constexpr double h = 1e-6;
  EXPECT_DOUBLE_EQ(f.a, value(1.3, 0.7));
  EXPECT_NEAR(f.v[0], (value(1.3 + h, 0.7) - value(1.3 - h, 0.7)) / (2.0 * h), 1e-8);
  EXPECT_NEAR(f.v[1], (value(1.3, 0.7 + h) - value(1.3, 0.7 - h)) / (2.0 * h), 1e-8);
  const D g = 2.0 + x / 4.0 - 1.0 - (1.0 / y) + -(y - 2.0);
  EXPECT_DOUBLE_EQ(g.a, 2.0 + 1.3 / 4.0 - 1.0 - 1.0 / 0.7 - (0.7 - 2.0));
  EXPECT_DOUBLE_EQ(g.v[0], 0.25);
  EXPECT_NEAR(g.v[1], 1.0 / 0.49 - 1.0, 1e-14);
}

}  // namespace
}  // namespace identikal
