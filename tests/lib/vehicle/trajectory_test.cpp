#include "lib/vehicle/trajectory.h"

#include <cmath>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "lib/base/random.h"

namespace identikal {
namespace {

using Eigen::VectorXd;

// Steady driving with sideslip: a circle of radius U / r about a point at right angles to the way.
TEST(Track, IsACircleForSteadyVelocities) {
  constexpr double vx = 16.0, vy = -0.7, r = 0.4;
  const VectorXd time = VectorXd::LinSpaced(71, 0.0, 7.0), one = VectorXd::Ones(71);
  const Pose start{3.0, -2.0, 0.3};
  const Eigen::Matrix3Xd way = track(time, vx * one, vy * one, r * one, start);
  const double course = start.psi + std::atan2(vy, vx), radius = std::hypot(vx, vy) / r;
  const Eigen::Vector2d centre(start.X - radius * std::sin(course),
                               start.Y + radius * std::cos(course));
  for (Eigen::Index t = 0; t < 71; ++t) {
    const double angle = course + r * time[t];
    EXPECT_NEAR(way(0, t), centre[0] + radius * std::sin(angle), 1e-12);
    EXPECT_NEAR(way(1, t), centre[1] - radius * std::cos(angle), 1e-12);
    EXPECT_NEAR(way(2, t), start.psi + r * time[t], 1e-12);
  }
  // Forward Euler is a polygon outside of it.
  const Eigen::Matrix3Xd polygon =
      track(time, vx * one, vy * one, r * one, start, TrackRule::forward_euler);
  EXPECT_GT((polygon.col(40).head<2>() - way.col(40).head<2>()).norm(), 0.1);
}

// Against the integral of a drive whose heading is known in closed form.
TEST(Track, OrderOfBothRules) {
  const auto error = [](int steps, TrackRule rule) {
    const VectorXd time = VectorXd::LinSpaced(steps + 1, 0.0, 4.0);
    const VectorXd vx = 15.0 + time.array(), vy = 0.5 * time.array().sin();
    const VectorXd r = 0.3 * (1.5 * time.array()).cos();
    const Eigen::Matrix3Xd way = track(time, vx, vy, r, {}, rule);
    // Simpson's rule with psi = 0.2 sin(1.5 t).
    Eigen::Vector2d truth = Eigen::Vector2d::Zero();
    constexpr int kFine = 4000;
    for (int i = 0; i <= kFine; ++i) {
      const double t = 4.0 * i / kFine, psi = 0.2 * std::sin(1.5 * t);
      const double w = (i == 0 || i == kFine ? 1.0 : i % 2 == 1 ? 4.0 : 2.0) * 4.0 / kFine / 3.0;
      truth += w * (Eigen::Rotation2Dd(psi) * Eigen::Vector2d(15.0 + t, 0.5 * std::sin(t)));
    }
    return (way.col(steps).head<2>() - truth).norm();
  };
  EXPECT_NEAR(error(80, TrackRule::arcs) / error(160, TrackRule::arcs), 4.0, 0.1);
  EXPECT_NEAR(error(80, TrackRule::forward_euler) / error(160, TrackRule::forward_euler), 2.0, 0.1);
  EXPECT_LT(error(40, TrackRule::arcs), 0.02);
}

TEST(Track, RefusesColumnsOfDifferentLength) {
  EXPECT_THROW(track(VectorXd::Ones(3), VectorXd::Ones(3), VectorXd::Ones(2), VectorXd::Ones(3)),
               std::invalid_argument);
  EXPECT_THROW(track(VectorXd(), VectorXd(), VectorXd(), VectorXd()), std::invalid_argument);
}

Eigen::Matrix2Xd lane_change_track() {
  Eigen::Matrix2Xd out(2, 70);
  for (Eigen::Index t = 0; t < 70; ++t) {
    const double X = 1.6 * static_cast<double>(t);
    out.col(t) << X, 3.2 * std::exp(-std::pow((X - 55.0) / 20.0, 2));
  }
  return out;
}

TEST(FitTrack, FindsTurnAndShift) {
  const Eigen::Matrix2Xd from = lane_change_track();
  for (const double angle : {0.033, -2.5, 3.1}) {
    const Eigen::Matrix2Xd to = (Eigen::Rotation2Dd(angle).toRotationMatrix() * from).colwise() +
                                Eigen::Vector2d(4.0, -7.0);
    const TrackFit fit = fit_track(from, to, true);
    EXPECT_NEAR(fit.angle, angle, 1e-13);
    EXPECT_LT((fit.shift - Eigen::Vector2d(4.0, -7.0)).norm(), 1e-11);
    EXPECT_LT(fit.rms, 1e-11);
    const TrackFit about_origin =
        fit_track(from, Eigen::Rotation2Dd(angle).toRotationMatrix() * from, false);
    EXPECT_NEAR(about_origin.angle, angle, 1e-13);
    EXPECT_EQ(about_origin.shift, Eigen::Vector2d::Zero());
  }
}

// No other turn is nearer: brute force over turns, each with its best shift.
TEST(FitTrack, IsTheLeastSquaresTurn) {
  const Eigen::Matrix2Xd from = lane_change_track();
  Random random(3);
  Eigen::Matrix2Xd to = Eigen::Rotation2Dd(0.2).toRotationMatrix() * from;
  for (Eigen::Index t = 0; t < to.cols(); ++t) to.col(t) += random.normal(2);
  const TrackFit fit = fit_track(from, to, true);
  double best = HUGE_VAL, at = 0.0;
  for (double angle = 0.1; angle < 0.3; angle += 1e-5) {
    const Eigen::Matrix2Xd left = to - Eigen::Rotation2Dd(angle).toRotationMatrix() * from;
    const double squares = (left.colwise() - left.rowwise().mean()).squaredNorm();
    if (squares < best) {
      best = squares;
      at = angle;
    }
  }
  EXPECT_NEAR(fit.angle, at, 1e-5);
  EXPECT_NEAR(fit.rms, std::sqrt(best / 70.0), 1e-9);
}

// 2000 tracks with noise of 3 cm: angle / se has unit variance (its estimate is within 6.3 % in 95
// of 100 such tests, the bounds here let through 1 false alarm in 10000), and the 95 % intervals
// cover between 93.0 and 97.0 % (4 standard deviations).
TEST(FitTrack, StandardErrorIsCovered) {
  const Eigen::Matrix2Xd from = lane_change_track();
  constexpr double kAngle = 1.9 * EIGEN_PI / 180.0;
  for (const bool with_shift : {false, true}) {
    Random random(with_shift ? 12 : 11);
    int covered = 0;
    double squares = 0.0;
    constexpr int kRuns = 2000;
    for (int run = 0; run < kRuns; ++run) {
      Eigen::Matrix2Xd to = Eigen::Rotation2Dd(kAngle).toRotationMatrix() * from;
      for (Eigen::Index t = 0; t < to.cols(); ++t) to.col(t) += 0.03 * random.normal(2);
      const TrackFit fit = fit_track(from, to, with_shift);
      const double z = (fit.angle - kAngle) / fit.angle_se;
      squares += z * z / kRuns;
      covered += std::abs(z) < 1.96 ? 1 : 0;
    }
    EXPECT_NEAR(squares, 1.0, 0.13);
    EXPECT_NEAR(covered / 2000.0, 0.95, 0.02);
  }
}

TEST(FitTrack, RefusesTracksWithoutDirection) {
  const Eigen::Matrix2Xd point = Eigen::Matrix2Xd::Ones(2, 5);
  EXPECT_THROW(fit_track(point, lane_change_track().leftCols(5), true), std::invalid_argument);
  EXPECT_THROW(fit_track(point.leftCols(1), point.leftCols(1), false), std::invalid_argument);
  EXPECT_THROW(fit_track(point, point.leftCols(3), false), std::invalid_argument);
}

}  // namespace
}  // namespace identikal
