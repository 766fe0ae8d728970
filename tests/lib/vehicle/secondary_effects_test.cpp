#include "lib/vehicle/secondary_effects.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "lib/base/constants.h"
#include "lib/vehicle/sladka2010_car.h"

namespace identikal {
namespace {

constexpr double kSpeed = 22.0;  // [m/s]

SingleTrack<> car() { return linear_car(sladka2010_car()); }

Eigen::VectorXd stamps(double step, double seconds) {
  return Eigen::VectorXd::LinSpaced(static_cast<Eigen::Index>(std::lround(seconds / step)) + 1, 0.0,
                                    seconds);
}

// A sine whose frequency rises to 2.5 Hz.
Eigen::VectorXd sweep(const Eigen::VectorXd& time) {
  return time.unaryExpr(
      [](double t) { return 0.4 * std::sin(2.0 * std::numbers::pi * (0.2 + 0.23 * t / 2) * t); });
}

DrivenSegment driven(const Eigen::VectorXd& time, const Eigen::VectorXd& steering, double step) {
  return drive(time, steering, Eigen::VectorXd::Constant(time.size(), kSpeed),
               {.longest_step = step});
}

// Rows r, vy, ay.
Eigen::MatrixXd with(const SecondaryEffects& effects, const DrivenSegment& segment) {
  Eigen::MatrixXd out(3, segment.rows());
  simulate_with_effects(car(), effects, segment, 0.0, 0.0,
                        [&](Eigen::Index k, const Motion& motion, double) {
                          out.col(k) << motion.r, motion.vy, motion.ay;
                        });
  return out;
}

Eigen::MatrixXd plain(const SingleTrack<>& of, const DrivenSegment& segment) {
  Eigen::MatrixXd out(3, segment.rows());
  simulate(of, segment, 0.0, 0.0, [&](Eigen::Index k, const Motion& motion, double) {
    out.col(k) << motion.r, motion.vy, motion.ay;
  });
  return out;
}

double difference(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  return ((a - b).rowwise().norm().cwiseQuotient(b.rowwise().norm())).maxCoeff();
}

TEST(SecondaryEffects, WithoutAnyItIsTheSingleTrackToSecondOrder) {
  const Eigen::VectorXd time = stamps(0.01, 10.0), steering = sweep(time);
  const Eigen::MatrixXd exact = plain(car(), driven(time, steering, 0.001));
  const double coarse = difference(with({}, driven(time, steering, 0.005)), exact);
  const double fine = difference(with({}, driven(time, steering, 0.0025)), exact);
  std::printf("against Runge-Kutta: %.1e with steps of 5 ms, %.1e with 2.5 ms\n", coarse, fine);
  EXPECT_LT(coarse, 1e-3);
  EXPECT_NEAR(coarse / fine, 4.0, 0.5);
}

TEST(SecondaryEffects, RelaxationIsThatOfTheSingleTrack) {
  const Eigen::VectorXd time = stamps(0.01, 10.0), steering = sweep(time);
  SingleTrack<> relaxing = car();
  relaxing.relaxation_length = 0.4;
  const Eigen::MatrixXd exact =
      plain(relaxing, drive(time, steering, Eigen::VectorXd::Constant(time.size(), kSpeed),
                            {.relaxation_length = 0.4, .longest_step = 0.001}));
  SecondaryEffects effects{};
  effects[kTyreRelaxation] = 0.4;
  EXPECT_LT(difference(with(effects, driven(time, steering, 0.005)), exact), 2e-3);
}

// The angle behind a first-order lag, by the exact solution for an input that goes evenly from
// sample to sample; samples of 1 ms, so that it does not matter how one reads between them.
TEST(SecondaryEffects, SteeringLagIsAFirstOrderFilter) {
  constexpr double kLag = 0.05, kStep = 0.001;
  const Eigen::VectorXd time = stamps(kStep, 5.0), steering = sweep(time);
  Eigen::VectorXd late = steering;
  for (Eigen::Index k = 1; k < late.size(); ++k) {
    late[k] = lagged(late[k - 1], steering[k - 1], steering[k], kStep, kLag);
  }
  SecondaryEffects effects{};
  effects[kSteeringLag] = kLag;
  EXPECT_LT(
      difference(with(effects, driven(time, steering, 0.005)), with({}, driven(time, late, 0.005))),
      1e-4);
}

TEST(SecondaryEffects, LaggedIsTheExactSolution) {
  // x' = (u - x)/T, u = 1 + 2 t, x(0) = 0: x = 1 + 2 (t - T) + (2 T - 1) e^(-t/T).
  const double T = 0.3, t = 0.2;
  EXPECT_NEAR(lagged(0.0, 1.0, 1.0 + 2.0 * t, t, T),
              1.0 + 2.0 * (t - T) + (2.0 * T - 1.0) * std::exp(-t / T), 1e-14);
  EXPECT_EQ(lagged(0.0, 1.0, 1.4, t, 0.0), 1.4);
}

TEST(SecondaryEffects, InSteadyCorneringRollShowsInAyAlone) {
  const Eigen::VectorXd time = stamps(0.01, 12.0);
  const DrivenSegment turn = driven(time, Eigen::VectorXd::Constant(time.size(), 0.5), 0.005);
  SecondaryEffects rolling{};
  rolling[kRollGradient] = 0.01;
  rolling[kRollSteerFront] = 0.001;
  rolling[kRollSteerRear] = -0.0005;
  const Eigen::VectorXd stiff = with({}, turn).rightCols<1>(),
                        soft = with(rolling, turn).rightCols<1>();
  EXPECT_NEAR(soft[0], stiff[0], 1e-6 * stiff[0]);
  EXPECT_NEAR(soft[1], stiff[1], 1e-6 * std::abs(stiff[1]));
  EXPECT_NEAR(soft[2], stiff[2] + kStandardGravity * std::sin(0.01 * stiff[2]), 1e-5);
}

TEST(SecondaryEffects, RollOfAnyFrequencyDampingAndHeightIsThatOfTheSingleTrack) {
  const Eigen::VectorXd time = stamps(0.01, 10.0), steering = sweep(time);
  SingleTrack<> rolls = car();
  rolls.roll_gradient = 0.008;
  rolls.roll_frequency = 2.2;
  rolls.roll_height = 0.3;
  rolls.roll_damping = 0.5;
  SecondaryEffects rolling{};
  rolling[kRollDecay] = std::log(rolls.roll_damping / 0.35);
  rolling[kRollGradient] = rolls.roll_gradient;
  rolling[kRollQuickness] = std::log(rolls.roll_frequency / 1.5);
  rolling[kRollArm] = rolls.roll_height - 0.17 * (rolls.a + rolls.b);
  const Eigen::MatrixXd exact = plain(rolls, driven(time, steering, 0.001));
  const double coarse = difference(with(rolling, driven(time, steering, 0.005)), exact);
  const double fine = difference(with(rolling, driven(time, steering, 0.0025)), exact);
  EXPECT_LT(fine, 1e-3);
  EXPECT_LT(fine, 0.3 * coarse);
}

// 0.2 m above the centre of gravity: less 0.2 m phi'', which is a difference of roll rates here.
TEST(SecondaryEffects, AnAccelerometerAboveTheCentreOfGravityFeelsTheBodyRoll) {
  const Eigen::VectorXd time = stamps(0.002, 10.0), steering = sweep(time);
  const DrivenSegment segment = driven(time, steering, 0.001);
  SecondaryEffects rolling{};
  rolling[kRollGradient] = 0.01;
  Eigen::VectorXd roll_rate(segment.rows());
  simulate_with_effects(
      car(), rolling, segment, 0.0, 0.0,
      [&](Eigen::Index k, const Motion& motion, double) { roll_rate[k] = motion.roll_rate; });
  const Eigen::VectorXd low = with(rolling, segment).row(2);
  rolling[kHeightOfAy] = 0.2;
  const Eigen::VectorXd high = with(rolling, segment).row(2);
  const Eigen::Index rows = segment.rows() - 2;
  const Eigen::VectorXd expected = -0.2 / 0.004 * (roll_rate.tail(rows) - roll_rate.head(rows));
  EXPECT_LT(((high - low).segment(1, rows) - expected).norm(), 2e-3 * expected.norm());
}

TEST(SecondaryEffects, TyresOfOneAxleBendByThemselves) {
  const Eigen::VectorXd time = stamps(0.01, 12.0);
  const DrivenSegment turn = driven(time, Eigen::VectorXd::Constant(time.size(), 0.5), 0.005);
  const double stiff = with({}, turn)(0, turn.rows() - 1);
  SecondaryEffects front{}, rear{};
  front[kTyreSoftening] = 1.0;
  front[kRearSoftening] = -50.0;
  rear[kTyreSoftening] = 1e-9;
  rear[kRearSoftening] = std::log(1e9);
  EXPECT_LT(with(front, turn)(0, turn.rows() - 1), 0.999 * stiff);  // turns less
  EXPECT_GT(with(rear, turn)(0, turn.rows() - 1), 1.001 * stiff);   // and more
}

TEST(SecondaryEffects, SmoothingMovesNothingInTime) {
  const Eigen::VectorXd time = stamps(0.01, 20.0);
  const auto sine = [](double t) { return 0.3 * std::sin(2.0 * t); };
  SecondaryEffects smooth{};
  smooth[kSteeringSmoothing] = 0.02;
  const DrivenSegment slalom = driven(time, time.unaryExpr(sine), 0.005);
  const Eigen::VectorXd r = with(smooth, slalom).row(0).segment(600, 800).transpose();
  const Eigen::VectorXd r0 = with({}, slalom).row(0).segment(600, 800).transpose();
  const double gain = r.dot(r0) / r0.squaredNorm();
  // Twice forwards and backwards: 1/(1 + (w T)^2)^2, w T = 0.04.
  EXPECT_NEAR(gain, 1.0 / std::pow(1.0 + 0.0016, 2), 2e-4);
  EXPECT_LT((r - gain * r0).norm() / r0.norm(), 1e-3);  // of another phase
}

// A circle at 6 m/s with the front wheels turned by 14 degrees: the balances of force and moment, written
// out again, with the drive in front, behind and shared.
TEST(SecondaryEffects, WideAnglesKeepTheBalancesOfATightTurn) {
  constexpr double kSlow = 6.0;
  const SingleTrack<> one = car();
  const Eigen::VectorXd time = stamps(0.01, 12.0);
  const double delta = 0.25;
  const DrivenSegment turn =
      drive(time, Eigen::VectorXd::Constant(time.size(), delta * one.steering_ratio),
            Eigen::VectorXd::Constant(time.size(), kSlow), {.longest_step = 0.005});
  for (const double share : {0.0, 0.4, 1.0}) {
    SecondaryEffects wide{};
    wide[kWideAngles] = 1.0;
    wide[kFrontDrive] = share;
    Motion end{};
    simulate_with_effects(one, wide, turn, 0.0, 0.0,
                          [&](Eigen::Index, const Motion& motion, double) { end = motion; });
    const double front =
        -one.front.stiffness * (std::atan((end.vy + one.a * end.r) / kSlow) - delta);
    const double rear = -one.rear.stiffness * std::atan((end.vy - one.b * end.r) / kSlow);
    // What drives the car, so that its speed stays.
    const double drive = front * std::sin(delta) - one.m * end.vy * end.r;
    const double across =
        front * std::cos(delta) + share * drive / std::cos(delta) * std::sin(delta);
    EXPECT_NEAR(across + rear, one.m * kSlow * end.r, 1e-6 * rear);
    EXPECT_NEAR(one.a * across, one.b * rear, 1e-6 * one.b * rear);
    EXPECT_NEAR(end.ay, (across + rear) / one.m, 1e-9);
  }
}

// Half of it: half of the way between what small angles give and what wide ones do.
TEST(SecondaryEffects, AShareOfWideAnglesLiesBetween) {
  const SingleTrack<> one = car();
  const Eigen::VectorXd time = stamps(0.01, 12.0);
  const DrivenSegment turn =
      drive(time, Eigen::VectorXd::Constant(time.size(), 0.25 * one.steering_ratio),
            Eigen::VectorXd::Constant(time.size(), 6.0), {.longest_step = 0.005});
  double r[3];
  for (int share = 0; share < 3; ++share) {
    SecondaryEffects wide{};
    wide[kWideAngles] = 0.5 * share;
    wide[kFrontDrive] = 0.7;
    simulate_with_effects(one, wide, turn, 0.0, 0.0,
                          [&](Eigen::Index, const Motion& motion, double) { r[share] = motion.r; });
  }
  EXPECT_GT(std::abs(r[2] / r[0] - 1.0), 0.005);
  EXPECT_NEAR((r[1] - r[0]) / (r[2] - r[0]), 0.5, 0.02);
}

TEST(SecondaryEffects, SmallAnglesAreAsTheyWere) {
  const Eigen::VectorXd time = stamps(0.01, 10.0);
  const DrivenSegment segment = driven(time, 0.02 * sweep(time), 0.005);
  SecondaryEffects wide{};
  wide[kWideAngles] = 1.0;
  wide[kFrontDrive] = 0.5;
  EXPECT_LT(difference(with(wide, segment), with({}, segment)), 1e-5);
}

}  // namespace
}  // namespace identikal
