#include "lib/vehicle/manoeuvre.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "lib/base/interpolation.h"
#include "lib/vehicle/motion.h"
#include "lib/vehicle/sladka2010_car.h"
#include "lib/vehicle/steering_response.h"

namespace identikal {
namespace {

TEST(SevereLaneChange, SwingsOutAndBackAndStops) {
  SevereLaneChange manoeuvre;
  manoeuvre.amplitude = 2.0;
  const Eigen::VectorXd time = Eigen::VectorXd::LinSpaced(70001, 0.0, 7.0);
  const Eigen::VectorXd angle = steering(manoeuvre, time);
  EXPECT_NEAR(angle.maxCoeff(), 2.0, 1e-6);
  EXPECT_NEAR(angle.minCoeff(), -2.0, 1e-6);
  EXPECT_EQ(steering(manoeuvre, manoeuvre.start), 0.0);
  EXPECT_EQ(steering(manoeuvre, 6.9), 0.0);
  EXPECT_GT(steering(manoeuvre, manoeuvre.start + 0.3 * manoeuvre.period),
            0.0);  // to the left first
}

TEST(SevereLaneChange, IsSmooth) {
  const SevereLaneChange manoeuvre;
  constexpr double h = 1e-4;
  double slope_before = 0.0;
  for (double t = 0.0; t < 7.0; t += h) {
    const double slope = (steering(manoeuvre, t + h) - steering(manoeuvre, t)) / h;
    EXPECT_LT(std::abs(slope - slope_before), 100.0 * h) << "at " << t;
    slope_before = slope;
  }
}

// What ISO 3888-2 asks of the car: about one lane to the side and back, hard but still on the road.
TEST(SevereLaneChange, MovesThePassengerCarByALane) {
  VehicleParameters<double> p = sladka2010_car();
  const SingleTrack<> car = linear_car(p);
  constexpr double h = 0.002;
  const Eigen::VectorXd time = Eigen::VectorXd::LinSpaced(3501, 0.0, 7.0);
  const DrivenSegment segment =
      drive(time, steering(SevereLaneChange{}, time), Eigen::VectorXd::Constant(3501, 60.0 / 3.6),
            {decay_rate_times_speed(car)});
  double heading = 0.0, side = 0.0, farthest = 0.0, hardest = 0.0;
  simulate(car, segment, 0.0, 0.0, [&](Eigen::Index, const Motion& motion, double vx) {
    side += h * (vx * std::sin(heading) + motion.vy * std::cos(heading));
    heading += h * motion.r;
    farthest = std::max(farthest, side);
    hardest = std::max(hardest, std::abs(motion.ay));
  });
  EXPECT_GT(farthest, 3.0);
  EXPECT_LT(farthest, 3.5);
  EXPECT_NEAR(hardest, 6.0, 0.3);
  EXPECT_NEAR(side, 0.0, 0.05);
  EXPECT_NEAR(heading, 0.0, 0.005);
}

TEST(SevereLaneChange, IsWellSampledAtTenHertz) {
  const SevereLaneChange manoeuvre;
  const Eigen::VectorXd samples = Eigen::VectorXd::LinSpaced(71, 0.0, 7.0);
  const Pchip between(samples, steering(manoeuvre, samples));
  double sum = 0.0;
  for (int i = 0; i < 7000; ++i) {
    const double t = 0.001 * i;
    sum += std::pow(between.in_interval(i / 100, t) - steering(manoeuvre, t), 2);
  }
  EXPECT_LT(std::sqrt(sum / 7000.0), 0.01 * manoeuvre.amplitude);
}

// Largest jump of the slope between neighbouring points, times their distance over the slope that
// is typical: a continuous slope leaves O(h), a jump O(1).
template <typename Manoeuvre>
double largest_jump_of_slope(const Manoeuvre& manoeuvre, double seconds, double h) {
  double before = 0.0, jump = 0.0;
  for (double t = 0.0; t < seconds; t += h) {
    const double slope = (steering(manoeuvre, t + h) - steering(manoeuvre, t)) / h;
    jump = std::max(jump, std::abs(slope - before));
    before = slope;
  }
  return jump;
}

TEST(StepSteer, RisesOnceWithinTheStandardsTime) {
  StepSteer step;
  step.amplitude = 0.7;
  EXPECT_EQ(steering(step, step.start), 0.0);
  EXPECT_NEAR(steering(step, step.start + 0.5 * step.rise), 0.35, 1e-12);
  EXPECT_DOUBLE_EQ(steering(step, step.start + step.rise), 0.7);
  EXPECT_DOUBLE_EQ(steering(step, 100.0), 0.7);
  double ten = 0.0, ninety = 0.0;
  for (double t = step.start; t < step.start + step.rise; t += 1e-5) {
    if (ten == 0.0 && steering(step, t) > 0.07) ten = t;
    if (ninety == 0.0 && steering(step, t) > 0.63) ninety = t;
  }
  EXPECT_LT(ninety - ten, 0.15);
  EXPECT_NEAR(ninety - ten, 0.59 * step.rise, 1e-3);
  EXPECT_NEAR(largest_jump_of_slope(step, 3.0, 1e-4) / largest_jump_of_slope(step, 3.0, 5e-5), 2.0,
              0.1);
}

// Amplitude and frequency by correlation with sine and cosine over whole periods.
TEST(SineSteer, HasItsFrequencyAndAmplitude) {
  SineSteer weave{0.3, 1.0, 0.2, 8.0};
  double in = 0.0, quadrature = 0.0, elsewhere = 0.0;
  constexpr int kPoints = 40000;
  for (int i = 0; i < kPoints; ++i) {
    const double t = 40.0 * (i + 0.5) / kPoints, p = 2.0 * EIGEN_PI * 0.2 * t;
    const double angle = steering(weave, 1.0 + t);
    in += 2.0 / kPoints * angle * std::sin(p);
    quadrature += 2.0 / kPoints * angle * std::cos(p);
    elsewhere += 2.0 / kPoints * angle * std::sin(2.0 * p);
  }
  EXPECT_NEAR(in, 0.3, 1e-9);
  EXPECT_NEAR(quadrature, 0.0, 1e-9);
  EXPECT_NEAR(elsewhere, 0.0, 1e-9);
  EXPECT_EQ(steering(weave, 0.99), 0.0);
  EXPECT_EQ(steering(weave, 41.01), 0.0);
}

// Zeros of a linear sweep: half a cycle between them, their distance shrinks as its frequency
// rises.
TEST(SweepSteer, RisesLinearlyInFrequency) {
  SweepSteer sweep;
  sweep.amplitude = 1.0;
  std::vector<double> zeros;
  constexpr double h = 1e-4;
  double largest = 0.0;
  for (double t = sweep.start + h; t < sweep.start + sweep.duration - h; t += h) {
    if (steering(sweep, t) * steering(sweep, t + h) < 0.0) zeros.push_back(t + 0.5 * h);
    largest = std::max(largest, std::abs(steering(sweep, t)));
  }
  EXPECT_NEAR(largest, 1.0, 1e-3);
  // 62 cycles from 0.1 to 3 Hz in 40 s.
  EXPECT_NEAR(static_cast<double>(zeros.size()), 123.0, 1.0);
  for (std::size_t i = 1; i < zeros.size(); ++i) {
    const double middle = 0.5 * (zeros[i - 1] + zeros[i]) - sweep.start;
    const double frequency = 0.5 / (zeros[i] - zeros[i - 1]);
    EXPECT_NEAR(frequency, 0.1 + 2.9 * middle / 40.0, 0.01) << middle;
  }
  EXPECT_NEAR(largest_jump_of_slope(sweep, 43.0, 1e-3) / largest_jump_of_slope(sweep, 43.0, 5e-4),
              2.0, 0.1);
}

TEST(SineWithDwell, HoldsTheSecondPeak) {
  SineWithDwell dwell;
  dwell.amplitude = 1.2;
  const double peak = dwell.start + 0.75 / 0.7;
  EXPECT_NEAR(steering(dwell, dwell.start + 0.25 / 0.7), 1.2, 1e-12);
  for (const double share : {0.0, 0.3, 1.0}) {
    EXPECT_NEAR(steering(dwell, peak + 0.5 * share), -1.2, 1e-12) << share;
  }
  EXPECT_GT(steering(dwell, peak + 0.51), -1.2);
  EXPECT_NEAR(steering(dwell, dwell.start + 0.5 / 0.7), 0.0, 1e-12);
  EXPECT_NEAR(steering(dwell, dwell.start + 1.0 / 0.7 + 0.5 - 1e-9), 0.0, 1e-8);
  EXPECT_EQ(steering(dwell, dwell.start + 1.0 / 0.7 + 0.5 + 1e-9), 0.0);
}

TEST(SteadyCircle, KeepsItsRadiusWhileTheSpeedRises) {
  VehicleParameters<double> p = sladka2010_car();
  const SingleTrack<> car = linear_car(p);
  const SteadyCircle circle;
  const Eigen::VectorXd time = Eigen::VectorXd::LinSpaced(4001, 0.0, 40.0);
  const Eigen::VectorXd vx = time.unaryExpr([&](double t) { return speed(circle, t); });
  EXPECT_LT((vx[1] - vx[0]) / 0.01, 0.7);  // forward acceleration [m/s^2]
  const Eigen::VectorXd angle =
      vx.unaryExpr([&](double u) { return 21.0 * road_wheel_angle(car, circle.radius, u); });
  const DrivenSegment segment = drive(time, angle, vx, {decay_rate_times_speed(car)});
  const Eigen::Vector2d start = steady_state(car, segment.nodes.front());
  simulate(car, segment, start[0], start[1], [&](Eigen::Index t, const Motion& motion, double u) {
    // Behind its steady state by the lag of the car, less than a tenth of a second.
    EXPECT_NEAR(u / motion.r, circle.radius, 0.01 * circle.radius) << time[t];
    const double ay = std::pow(circle.start_speed, 2) / 100.0 + 0.1 * time[t];
    EXPECT_NEAR(u * motion.r, ay, 0.01 * ay + 0.01) << time[t];
  });
}

TEST(SteadyCircle, AngleOfALateralAcceleration) {
  const SingleTrack<> car = linear_car(sladka2010_car());
  const double u = 100.0 / 3.6;
  EXPECT_NEAR(4.0 / steering_response(car, u).ay_gain, road_wheel_angle(car, u * u / 4.0, u),
              1e-15);
}

}  // namespace
}  // namespace identikal
