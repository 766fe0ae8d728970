// Where did the car drive? Position from velocities, and the turn and shift between two tracks.
#pragma once

#include <Eigen/Core>

namespace identikal {

/// Position of the centre of gravity and heading in axes fixed to the road, z up.
struct Pose {
  double X = 0.0, Y = 0.0;  ///< [m]
  double psi = 0.0;         ///< from X to the car's x axis, positive to the left [rad]; not wrapped
};

/// The pose after `dt` seconds at constant velocities in the car's axes: an arc of a circle,
///   [dX; dY] = Rot(psi + turn/2) [vx; vy] dt sin(turn/2) / (turn/2),  turn = r dt.
/// @param vx, vy  [m/s]; @param r  [rad/s]; @param dt  [s]
Pose moved(const Pose& from, double vx, double vy, double r, double dt);

/// How velocities between two samples are read.
enum class TrackRule {
  forward_euler,  ///< those of the earlier sample, heading fixed: Sladká (2010), (9.2); error ~ dt
  arcs,           ///< the means of both samples, on an arc: error ~ dt^2, none on a steady circle
};

/// psi' = r,  X' = vx cos psi - vy sin psi,  Y' = vx sin psi + vy cos psi.
///
/// Example:
///
///     const Eigen::Matrix3Xd driven = track(time, y.row(0), y.row(1), y.row(2));  // vx, vy, r
///
/// Source: Sladká (2010), (9.2) and section 9.3.2.
/// @param time  N >= 1 time stamps [s], any spacing; @param vx, vy  N [m/s]; @param r  N [rad/s]
/// @param start  pose at the first sample
/// @return 3 x N: X [m], Y [m], psi [rad]
/// @throws std::invalid_argument when the sizes differ or N = 0
Eigen::Matrix3Xd track(const Eigen::VectorXd& time, const Eigen::VectorXd& vx,
                       const Eigen::VectorXd& vy, const Eigen::VectorXd& r, const Pose& start = {},
                       TrackRule rule = TrackRule::arcs);

/// to = Rot(angle) from + shift.
struct TrackFit {
  double angle = 0.0;                               ///< positive to the left, in (-pi, pi] [rad]
  Eigen::Vector2d shift = Eigen::Vector2d::Zero();  ///< [m]
  double angle_se = 0.0;  ///< standard error of the angle [rad], from the distances left over
  double rms = 0.0;       ///< of the distances left over [m]
};

/// The turn, with or without a shift, that brings one track nearest to another: least squares in
/// closed form (Kabsch 1976 in two dimensions). With a shift the points are taken from their means;
/// without, the turn is about the origin, so both tracks should begin there.
///   angle = atan2(sum a x b, sum a . b),  var(angle) = s^2 / sum |a|^2,
/// a and b the points of `from` and `to`, s^2 = left-over squares per degree of freedom: 2N - 3
/// with a shift, 2N - 1 without. The standard error supposes errors of `to` alone that are
/// independent and of one size; a track integrated from noisy velocities has others.
/// @param from, to  2 x N, N >= 2 [m], points of the same times
/// @throws std::invalid_argument when the shapes differ, N < 2, or all points of one track coincide
TrackFit fit_track(const Eigen::Matrix2Xd& from, const Eigen::Matrix2Xd& to, bool with_shift);

}  // namespace identikal
