#include "lib/vehicle/lane_change.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "lib/vehicle/sladka2010_car.h"

namespace identikal {
namespace {

using Eigen::VectorXd;

constexpr double kSixty = 60.0 / 3.6;

struct Driven {
  VectorXd time, steering, vy, r;
  double hardest = 0.0;
  Eigen::Matrix3Xd poses;
};

Driven driven(const SingleTrack<>& car, const PlannedPath& path, double seconds, double rate,
              double speed = kSixty) {
  const auto N = static_cast<Eigen::Index>(seconds * rate);
  Driven out;
  out.time = VectorXd::LinSpaced(N, 0.0, static_cast<double>(N - 1) / rate);
  out.steering.resize(N);
  out.vy = out.r = out.steering;
  out.poses = drive_along(car, path, PreviewDriver{}, out.time, VectorXd::Constant(N, speed), -20.0,
                          [&out](Eigen::Index row, const Motion& motion, double, double steering) {
                            out.steering[row] = steering;
                            out.vy[row] = motion.vy;
                            out.r[row] = motion.r;
                            out.hardest = std::max(out.hardest, std::abs(motion.ay));
                          });
  return out;
}

// The standards' tables for a width of 2 m, by hand.
TEST(TimeHistory, HasTheStandardsDimensions) {
  const std::vector<Gate> part1 = double_lane_change_course(2.0);
  ASSERT_EQ(part1.size(), 3U);
  const double begin1[] = {0.0, 45.0, 95.0}, end1[] = {15.0, 70.0, 125.0};
  const double width1[] = {2.45, 2.65, 2.85};
  const std::vector<Gate> part2 = obstacle_avoidance_course(2.0);
  ASSERT_EQ(part2.size(), 3U);
  const double begin2[] = {0.0, 25.5, 49.0}, end2[] = {12.0, 36.5, 61.0};
  const double width2[] = {2.45, 3.0, 3.0};
  for (std::size_t g = 0; g < 3; ++g) {
    EXPECT_DOUBLE_EQ(part1[g].begin, begin1[g]);
    EXPECT_DOUBLE_EQ(part1[g].end, end1[g]);
    EXPECT_NEAR(part1[g].left - part1[g].right, width1[g], 1e-12);
    EXPECT_DOUBLE_EQ(part2[g].begin, begin2[g]);
    EXPECT_DOUBLE_EQ(part2[g].end, end2[g]);
    EXPECT_NEAR(part2[g].left - part2[g].right, width2[g], 1e-12);
  }
  EXPECT_NEAR(part1[1].right - part1[0].right, 3.5, 1e-12);
  EXPECT_NEAR(part1[2].right - part1[0].right, 0.0, 1e-12);
  EXPECT_NEAR(part2[1].right - part2[0].left, 1.0, 1e-12);
  EXPECT_NEAR(part2[1].right - part2[2].left, 1.0, 1e-12);
  EXPECT_NEAR(part1[0].middle(), 0.0, 1e-12);
  EXPECT_NEAR(part2[0].middle(), 0.0, 1e-12);
  // Above 2.115 m the last gate of part 2 grows with the car.
  const Gate wide = obstacle_avoidance_course(2.3).back();
  EXPECT_NEAR(wide.left - wide.right, 1.3 * 2.3 + 0.25, 1e-12);
}

TEST(PlannedPath, HasAContinuousCurvature) {
  const PlannedPath path = planned_path(obstacle_avoidance_course(1.8), 1.8);
  constexpr double h = 0.01;
  double before = 0.0;
  for (double X = -10.0; X < 80.0; X += h) {
    const double curvature = (path.Y(X + h) - 2.0 * path.Y(X) + path.Y(X - h)) / (h * h);
    EXPECT_LT(std::abs(curvature - before), 2e-3) << X;
    before = curvature;
  }
}

// A car that stands still in a gate, by hand.
TEST(GatePassages, AreDistancesOfTheRectangle) {
  const std::vector<Gate> course{{0.0, 12.0, -1.5, 1.5}, {20.0, 30.0, -1.0, 2.0}};
  const CarBody body{2.0, 2.0, 2.5};
  Eigen::Matrix3Xd pose(3, 1);
  pose << 5.0, 0.2, 0.0;
  std::vector<GatePassage> passed = gate_passages(course, body, pose);
  EXPECT_NEAR(passed[0].clearance, 0.3, 1e-12);  // left side at 1.2
  EXPECT_TRUE(std::isnan(passed[1].clearance));
  // Turned left by 0.1: the tail is longer, so its right corner is the nearest.
  pose << 5.0, 0.0, 0.1;
  passed = gate_passages(course, body, pose);
  EXPECT_NEAR(passed[0].clearance, 1.5 - (2.5 * std::sin(0.1) + 1.0 * std::cos(0.1)), 1e-12);
  // The nose alone is in the gate: where its side crosses the begin counts, not the tail.
  pose << -1.0, 0.0, 0.1;
  passed = gate_passages(course, body, pose);
  const double at_begin = 1.0 / std::cos(0.1) + std::tan(0.1) * 1.0;
  const double corner = 2.0 * std::sin(0.1) + std::cos(0.1);
  EXPECT_NEAR(passed[0].clearance, 1.5 - std::max(at_begin, corner), 1e-12);
  pose << 25.0, 1.5, 0.0;
  EXPECT_NEAR(gate_passages(course, body, pose)[1].clearance, -0.5, 1e-12);
}

TEST(DriveAlong, PassesEveryGateAtSixty) {
  const auto car = linear_car(sladka2010_car());
  const CarBody body;
  for (const auto& course :
       {double_lane_change_course(body.width), obstacle_avoidance_course(body.width)}) {
    const PlannedPath path = planned_path(course, body.width);
    const double seconds = (course.back().end + 25.0) / kSixty;
    const Driven drive = driven(car, path, seconds, 100.0);
    for (const GatePassage& gate : gate_passages(course, body, drive.poses)) {
      EXPECT_GT(gate.clearance, 0.02) << gate.at;
    }
    for (Eigen::Index t = 0; t < drive.poses.cols(); ++t) {
      EXPECT_NEAR(drive.poses(1, t), path.Y(drive.poses(0, t)), 0.07);
    }
    // What a linear tyre allows; a road does not.
    EXPECT_LT(drive.hardest, 12.0);
  }
}

// Tyres that give 7 m/s^2, at 100 km/h.
TEST(DriveAlong, HitsConesWhenItIsTooFast) {
  const CarBody body;
  const auto course = obstacle_avoidance_course(body.width);
  auto p = sladka2010_car();
  p[kInverseSaturationFront] = p[kInverseSaturationRear] = 1.0 / std::pow(5000.0, 2);
  const Driven drive = driven(car_with(TyreCurve::tanh, p), planned_path(course, body.width), 4.0,
                              100.0, 100.0 / 3.6);
  double worst = 1.0;
  for (const GatePassage& gate : gate_passages(course, body, drive.poses)) {
    if (gate.clearance < worst) worst = gate.clearance;
  }
  EXPECT_LT(worst, 0.0);
}

// What the driver steers, steered open loop, moves the car the same way.
TEST(DriveAlong, IsTheCarsAnswerToTheSteering) {
  auto p = sladka2010_car();
  p[kSteeringGain] = 1.1;
  p[kSteeringOffset] = 0.05;
  const auto car = linear_car(p);
  const Driven closed = driven(car, planned_path(double_lane_change_course(1.8), 1.8), 6.0, 50.0);
  const VectorXd vx = VectorXd::Constant(closed.time.size(), kSixty);
  simulate(car, drive(closed.time, closed.steering, vx, {decay_rate_times_speed(car)}), 0.0, 0.0,
           [&](Eigen::Index row, const Motion& motion, double) {
             EXPECT_NEAR(motion.vy, closed.vy[row], 2e-3);
             EXPECT_NEAR(motion.r, closed.r[row], 2e-3);
           });
  // Finer samples of the same drive are the same drive.
  const Driven finer = driven(car, planned_path(double_lane_change_course(1.8), 1.8), 6.0, 100.0);
  for (Eigen::Index row = 0; row < closed.time.size(); ++row) {
    EXPECT_NEAR(finer.r[2 * row], closed.r[row], 2e-3);
  }
}

}  // namespace
}  // namespace identikal
