#include "lib/vehicle/lane_change.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/QR>

#include "lib/base/constants.h"
#include "lib/model/discretise.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

}  // namespace

std::vector<Gate> double_lane_change_course(double width) {
  const double first = 1.1 * width + 0.25, right = -0.5 * first;
  const double second = 1.2 * width + 0.25, last = 1.3 * width + 0.25;
  return {{0.0, 15.0, right, right + first},
          {45.0, 70.0, right + 3.5, right + 3.5 + second},
          {95.0, 125.0, right, right + last}};
}

std::vector<Gate> obstacle_avoidance_course(double width) {
  const double first = 1.1 * width + 0.25, left = 0.5 * first;
  const double last = std::max(3.0, 1.3 * width + 0.25);
  return {{0.0, 12.0, left - first, left},
          {25.5, 36.5, left + 1.0, left + 1.0 + width + 1.0},
          {49.0, 61.0, left - last, left}};
}

double PlannedPath::Y(double X) const {
  double out = line;
  for (const Shift& shift : shifts) {
    const double s = std::clamp((X - shift.begin) / (shift.end - shift.begin), 0.0, 1.0);
    out += shift.by * s * s * s * (10.0 + s * (6.0 * s - 15.0));
  }
  return out;
}

PlannedPath planned_path(const std::vector<Gate>& course, double car_width) {
  constexpr double kReach = 5.0;  // of a shift into the gates [m]
  constexpr double kAside = 0.5;  // of the room beside the car
  const Gate &first = course[0], &second = course[1];
  const double room = 0.5 * (first.left - first.right - car_width);
  PlannedPath out;
  out.line = first.middle() - kAside * std::copysign(room, second.middle() - first.middle());
  double line = out.line;
  for (std::size_t g = 1; g < course.size(); ++g) {
    out.shifts.push_back(
        {course[g - 1].end - kReach, course[g].begin + kReach, course[g].middle() - line});
    line = course[g].middle();
  }
  return out;
}

double steering_rate(const PreviewDriver& driver, const PlannedPath& path, const SingleTrack<>& car,
                     const Pose& pose, double vx, double vy, double r, double delta) {
  constexpr Index kMoves = 20;
  const double step = driver.preview / kMoves;
  // x = (Y, psi, vy, r, delta), steered by its rate; small angles to the course.
  const SingleTrackMatrices motion = single_track_matrices(car, vx);
  StateSpace model;
  model.A = MatrixXd::Zero(5, 5);
  model.A(0, 1) = vx;
  model.A(0, 2) = model.A(1, 3) = 1.0;
  model.A.block<2, 2>(2, 2) = motion.A;
  model.A.block<2, 1>(2, 4) = motion.B;
  model.B = MatrixXd::Identity(5, 5).rightCols<1>();
  model.C = MatrixXd::Identity(5, 5).topRows<1>();
  model.D = MatrixXd::Zero(1, 1);
  model.G = MatrixXd::Zero(5, 1);
  model.Q = model.R = MatrixXd::Zero(1, 1);
  model.S = MatrixXd::Zero(1, 1);
  model.x0 = VectorXd::Zero(5);
  model.P0 = MatrixXd::Zero(5, 5);
  const StateSpace sampled = discretise(model, ProcessNoise::per_sample, step);
  VectorXd x(5);
  x << pose.Y, pose.psi, vy, r, delta;
  MatrixXd effect = MatrixXd::Zero(2 * kMoves, kMoves);  // of the rates on Y, below on the effort
  VectorXd missing = VectorXd::Zero(2 * kMoves);
  VectorXd response = sampled.B;  // of the state, j steps after a rate of 1
  for (Index j = 0; j < kMoves; ++j) {
    x = sampled.A * x;
    missing[j] = path.Y(pose.X + vx * step * static_cast<double>(j + 1)) - x[0];
    for (Index i = 0; i + j < kMoves; ++i) effect(i + j, i) = response[0];
    response = sampled.A * response;
  }
  effect.bottomRows(kMoves).diagonal().setConstant(driver.effort);
  return effect.householderQr().solve(missing)[0];
}

std::vector<GatePassage> gate_passages(const std::vector<Gate>& course, const CarBody& body,
                                       const Eigen::Ref<const Eigen::Matrix3Xd>& poses) {
  constexpr double kNever = kNaN;
  std::vector<GatePassage> out(course.size(), {kNever, kNever});
  const double half = 0.5 * body.width;
  const std::array<Eigen::Vector2d, 4> outline{
      Eigen::Vector2d(body.front, half), Eigen::Vector2d(-body.rear, half),
      Eigen::Vector2d(-body.rear, -half), Eigen::Vector2d(body.front, -half)};
  for (Index t = 0; t < poses.cols(); ++t) {
    const double c = std::cos(poses(2, t)), s = std::sin(poses(2, t));
    std::array<Eigen::Vector2d, 4> corner;
    for (std::size_t i = 0; i < 4; ++i) {
      corner[i] << poses(0, t) + c * outline[i][0] - s * outline[i][1],
          poses(1, t) + s * outline[i][0] + c * outline[i][1];
    }
    for (std::size_t g = 0; g < course.size(); ++g) {
      const Gate& gate = course[g];
      for (std::size_t i = 0; i < 4; ++i) {
        // The part of this side that is in the gate has its extremes at its ends.
        const Eigen::Vector2d &p = corner[i], &q = corner[(i + 1) % 4];
        const double low = std::max(std::min(p[0], q[0]), gate.begin);
        const double high = std::min(std::max(p[0], q[0]), gate.end);
        if (low > high) continue;
        for (const double X : {low, high}) {
          const double share = q[0] == p[0] ? 0.0 : (X - p[0]) / (q[0] - p[0]);
          const double Y = p[1] + share * (q[1] - p[1]);
          const double clearance = std::min(gate.left - Y, Y - gate.right);
          if (!(clearance >= out[g].clearance)) out[g] = {clearance, X};
        }
      }
    }
  }
  return out;
}

namespace {

/// The linear car with the same mass, lengths and stiffnesses at small slip: what a driver knows.
SingleTrack<> linearised(const SingleTrack<>& car) {
  SingleTrack<> out;
  out.m = car.m;
  out.a = car.a;
  out.b = car.b;
  out.Iz = car.Iz;
  out.front.stiffness = car.front.effective_stiffness();
  out.rear.stiffness = car.rear.effective_stiffness();
  return out;
}

}  // namespace

Eigen::Matrix3Xd drive_along(
    const SingleTrack<>& car, const PlannedPath& path, const PreviewDriver& driver,
    const Eigen::VectorXd& time, const Eigen::VectorXd& vx, double start,
    const std::function<void(Eigen::Index, const Motion&, double, double)>& observe) {
  const SingleTrack<> driver_model = linearised(car);
  const IntegrationDemand demand{decay_rate_times_speed(car)};
  const auto angle = [&car](double delta) {
    return delta * car.steering_ratio / car.steering_gain - car.steering_offset;
  };
  std::vector<Pose> poses{{start, path.Y(start), 0.0}};
  double vy = 0.0, r = 0.0, delta = 0.0;
  for (Eigen::Index row = 0; row + 1 < time.size(); ++row) {
    const double dt = time[row + 1] - time[row];
    const int looks = std::max(1, static_cast<int>(std::ceil(dt / driver.update - 1e-6)));
    const double h = dt / looks;
    for (int look = 0; look < looks; ++look) {
      const double share = static_cast<double>(look) / looks;
      const Eigen::Vector2d u =
          vx[row] + (vx[row + 1] - vx[row]) * Eigen::Array2d(share, share + 1.0 / looks);
      const double next =
          delta + h * steering_rate(driver, path, driver_model, poses.back(), u[0], vy, r, delta);
      const DrivenSegment segment =
          drive(Eigen::Vector2d(0.0, h), Eigen::Vector2d(angle(delta), angle(next)), u, demand);
      const double vy_before = vy, r_before = r;
      simulate(car, segment, vy_before, r_before,
               [&](Eigen::Index end, const Motion& motion, double speed) {
                 if (end == 1) {
                   vy = motion.vy;
                   r = motion.r;
                   if (row + 2 == time.size() && look + 1 == looks) {
                     observe(row + 1, motion, speed, angle(next));
                   }
                 } else if (look == 0) {
                   observe(row, motion, speed, angle(delta));
                 }
               });
      poses.push_back(
          moved(poses.back(), u.mean(), 0.5 * (vy_before + vy), 0.5 * (r_before + r), h));
      delta = next;
    }
  }
  Eigen::Matrix3Xd out(3, static_cast<Eigen::Index>(poses.size()));
  for (std::size_t i = 0; i < poses.size(); ++i) {
    out.col(static_cast<Eigen::Index>(i)) << poses[i].X, poses[i].Y, poses[i].psi;
  }
  return out;
}

}  // namespace identikal
