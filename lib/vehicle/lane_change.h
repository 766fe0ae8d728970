// Does the car get through the gates? Lane changes of ISO 3888 with a driver at the wheel.
#pragma once

#include <functional>
#include <vector>

#include <Eigen/Core>

#include "lib/vehicle/motion.h"
#include "lib/vehicle/trajectory.h"

namespace identikal {

/// A section of the course between two rows of cones. Axes of the course: X along it from the begin
/// of section 1, Y to the left of the middle of section 1.
struct Gate {
  double begin, end;   ///< X [m]
  double right, left;  ///< Y of the cones [m]

  double middle() const { return 0.5 * (right + left); }
};

/// ISO 3888-1:2018, double lane-change, 125 m: sections of 15, 30, 25, 25 and 30 m, of which the
/// first, third and last are gates, 1.1 w + 0.25 m, 1.2 w + 0.25 m and 1.3 w + 0.25 m wide; right
/// edges in line but for the third, which lies 3.5 m to the left.
/// @param width  of the car without mirrors, w [m], > 0
std::vector<Gate> double_lane_change_course(double width);

/// ISO 3888-2:2011, obstacle avoidance, 61 m: sections of 12, 13.5, 11, 12.5 and 12 m; gates 1.1 w
/// + 0.25 m, w + 1 m and the larger of 3 m and 1.3 w + 0.25 m wide. 1 m lies between the left edges
/// of the first and the last gate and the right edge of the one between them.
/// @param width  of the car without mirrors, w [m], > 0
std::vector<Gate> obstacle_avoidance_course(double width);

/// The car seen from above: a rectangle about the centre of gravity.
struct CarBody {
  double width = 1.8;  ///< without mirrors [m]
  double front = 1.9;  ///< centre of gravity to front end [m]
  double rear = 2.4;   ///< centre of gravity to rear end [m]
};

/// The line that the centre of gravity should follow: straight through each gate, with shifts from
/// line to line that have a continuous curvature, 10 s^3 - 15 s^4 + 6 s^5.
struct PlannedPath {
  struct Shift {
    double begin, end;  ///< X [m]
    double by;          ///< to the left [m]
  };
  double line = 0.0;  ///< Y before the first shift [m]
  std::vector<Shift> shifts;

  double Y(double X) const;  ///< [m]
};

/// Through the middles of the gates, but in the first one halfway towards the cones on the side
/// away from the next: the car needs the room for its tail. Every shift begins 5 m before the end
/// of one gate and ends 5 m into the next. With these numbers the passenger car of Sladká (2010)
/// passes both courses at 60 km/h; with more reach it drives smoother but hits cones. Width in m.
///
/// Example:
///
///     const auto course = double_lane_change_course(1.8);
///     const PlannedPath path = planned_path(course, 1.8);
///     const Eigen::VectorXd vx = Eigen::VectorXd::Constant(time.size(), 60.0 / 3.6);
///     const auto poses = drive_along(car, path, {}, time, vx, 0.0, [](auto...) {});
///     const auto gates = gate_passages(course, CarBody{}, poses);  // clearance < 0: cones fell
PlannedPath planned_path(const std::vector<Gate>& course, double car_width);

/// A driver who looks ahead: at every `update` he chooses the rates of steering over the preview
/// that make
///   sum_j (Y_j - path(X_j))^2 + effort^2 sum_j rate_j^2
/// least, as the linear car at its present speed would move, and steers by the first of them until
/// he looks again. Optimal preview control after MacAdam (1981) and Sharp, Casanova & Symonds
/// (2000). He knows the path; no reaction time is modelled.
struct PreviewDriver {
  double preview = 1.0;  ///< [s]
  double effort = 0.1;   ///< metres of path error as bad as a road-wheel rate of 1 rad/s [m s/rad]
  double update = 0.02;  ///< [s]
};

/// Road-wheel rate [rad/s] that the driver steers with until he looks again.
/// @param car  as the driver takes it to be; @param vx, vy  [m/s]; @param r  [rad/s]
/// @param delta  road-wheel angle now [rad]
double steering_rate(const PreviewDriver& driver, const PlannedPath& path, const SingleTrack<>& car,
                     const Pose& pose, double vx, double vy, double r, double delta);

/// How a gate was passed.
struct GatePassage {
  double clearance;  ///< smallest distance from car to cones [m]; < 0: cones fell; NaN: not reached
  double at;         ///< X of that place [m]
};

/// Smallest distances between the rectangle of the car and the edges of each gate while the one is
/// inside the other.
/// @param poses  3 x N: X, Y [m], psi [rad], close together (a clearance is that of some pose)
std::vector<GatePassage> gate_passages(const std::vector<Gate>& course, const CarBody& body,
                                       const Eigen::Ref<const Eigen::Matrix3Xd>& poses);

/// Drives the car along the path, straight ahead at first, and calls
/// observe(row, motion, vx, steering) at every time stamp; steering is the angle that the car's
/// sensor would measure [rad]. Between two looks of the driver steering changes evenly.
/// @param time  N >= 2 rising time stamps [s]; @param vx  N [m/s], > 0, linear in between
/// @param start  X of the centre of gravity at the first of them [m]; it begins on the path
/// The car has neither steering delay nor relaxation length: between two looks it starts from
/// (vy, r).
/// @return the poses at every look, 3 x M
Eigen::Matrix3Xd drive_along(const SingleTrack<>& car, const PlannedPath& path,
                             const PreviewDriver& driver, const Eigen::VectorXd& time,
                             const Eigen::VectorXd& vx, double start,
                             const std::function<void(Eigen::Index row, const Motion& motion,
                                                      double vx, double steering)>& observe);

}  // namespace identikal
