#include "lib/manoeuvre.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "lib/interpolation.h"
#include "lib/single_track.h"
#include "tests/support/thesis_car.h"

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
  VehicleParameters<double> p = thesis_car();
  const SingleTrack<double> car = linear_car(p);
  constexpr double h = 0.002;
  const Eigen::VectorXd time = Eigen::VectorXd::LinSpaced(3501, 0.0, 7.0);
  const DrivenStretch stretch =
      drive(time, steering(SevereLaneChange{}, time), Eigen::VectorXd::Constant(3501, 60.0 / 3.6),
            {decay_rate_times_speed(car)});
  double heading = 0.0, side = 0.0, farthest = 0.0, hardest = 0.0;
  simulate(car, stretch, 0.0, 0.0, [&](Eigen::Index, const Motion<double>& motion, double vx) {
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

}  // namespace
}  // namespace identikal
