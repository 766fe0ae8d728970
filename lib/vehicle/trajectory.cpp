#include "lib/vehicle/trajectory.h"

#include <cmath>
#include <stdexcept>

#include <Eigen/Geometry>

#include "lib/base/message.h"

namespace identikal {
namespace {

using Eigen::Index;

/// sin(x) / x.
double sine_ratio(double x) { return std::abs(x) < 1e-4 ? 1.0 - x * x / 6.0 : std::sin(x) / x; }

}  // namespace

Pose moved(const Pose& from, double vx, double vy, double r, double dt) {
  const double half = 0.5 * r * dt, chord = dt * sine_ratio(half);
  const double c = std::cos(from.psi + half), s = std::sin(from.psi + half);
  return {from.X + chord * (vx * c - vy * s), from.Y + chord * (vx * s + vy * c),
          from.psi + r * dt};
}

Eigen::Matrix3Xd track(const Eigen::VectorXd& time, const Eigen::VectorXd& vx,
                       const Eigen::VectorXd& vy, const Eigen::VectorXd& r, const Pose& start,
                       TrackRule rule) {
  const Index N = time.size();
  if (N == 0 || vx.size() != N || vy.size() != N || r.size() != N) {
    throw std::invalid_argument(message({"track: ", N, " time stamps, ", vx.size(), " vx, ",
                                         vy.size(), " vy, ", r.size(), " yaw rates"}));
  }
  Eigen::Matrix3Xd out(3, N);
  Pose pose = start;
  out.col(0) << pose.X, pose.Y, pose.psi;
  for (Index t = 1; t < N; ++t) {
    const double dt = time[t] - time[t - 1];
    if (rule == TrackRule::forward_euler) {
      const double c = std::cos(pose.psi), s = std::sin(pose.psi);
      pose.X += dt * (vx[t - 1] * c - vy[t - 1] * s);
      pose.Y += dt * (vx[t - 1] * s + vy[t - 1] * c);
      pose.psi += dt * r[t - 1];
    } else {
      pose = moved(pose, 0.5 * (vx[t - 1] + vx[t]), 0.5 * (vy[t - 1] + vy[t]),
                   0.5 * (r[t - 1] + r[t]), dt);
    }
    out.col(t) << pose.X, pose.Y, pose.psi;
  }
  return out;
}

TrackFit fit_track(const Eigen::Matrix2Xd& from, const Eigen::Matrix2Xd& to, bool with_shift) {
  const Index N = from.cols();
  if (N < 2 || to.cols() != N) {
    throw std::invalid_argument(
        message({"fit_track: ", N, " and ", to.cols(), " points; as many, and two at least"}));
  }
  Eigen::Vector2d centre_from = Eigen::Vector2d::Zero(), centre_to = centre_from;
  if (with_shift) {
    centre_from = from.rowwise().mean();
    centre_to = to.rowwise().mean();
  }
  const Eigen::Matrix2Xd a = from.colwise() - centre_from, b = to.colwise() - centre_to;
  const double dot = a.cwiseProduct(b).sum();
  const double cross = (a.row(0).cwiseProduct(b.row(1)) - a.row(1).cwiseProduct(b.row(0))).sum();
  const double spread = a.squaredNorm();
  if (!(spread > 0.0 && b.squaredNorm() > 0.0)) {
    throw std::invalid_argument("fit_track: all points of a track coincide; it has no direction");
  }
  TrackFit out;
  out.angle = std::atan2(cross, dot);
  const Eigen::Rotation2Dd turn(out.angle);
  if (with_shift) out.shift = centre_to - turn * centre_from;
  const double left_over = (b - turn.toRotationMatrix() * a).squaredNorm();
  const auto points = static_cast<double>(N);
  out.rms = std::sqrt(left_over / points);
  out.angle_se = std::sqrt(left_over / (2.0 * points - (with_shift ? 3.0 : 1.0)) / spread);
  return out;
}

}  // namespace identikal
