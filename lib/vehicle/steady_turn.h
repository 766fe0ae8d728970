// How is the car steered, and how does it stand, in a steady turn?
#pragma once

#include "lib/vehicle/single_track.h"

namespace identikal {

/// The slip angle [rad] at which an axle gives this side force [N], on the rising part of its
/// curve; NaN for a force that it does not reach.
double slip_angle_at(const Axle<>& axle, double force);

/// The largest side force of an axle [N]; infinite for a linear one.
double largest_force(const Axle<>& axle);

struct SteadyTurn {
  double road_wheel_angle;  ///< [rad]
  double sideslip;          ///< vy / vx [rad]
};

/// The point of the characteristic curve (ISO 4138) at a lateral acceleration and speed, both
/// constant, on a level road:
///   Ff = m ay b/L,  Fr = m ay a/L,
///   delta = L ay/vx^2 - alpha_f + alpha_r,  beta = b ay/vx^2 + alpha_r.
/// NaN where an axle does not reach its force. Of linear axles delta = (L/vx^2 + K) ay.
/// @param ay  vx r [m/s^2], positive to the left; @param vx  [m/s], > 0
///
/// Example:
///
///     const SteadyTurn turn = steady_turn(car, 4.0, 80.0 / 3.6);  // 4 m/s^2 at 80 km/h
///     const double wheel = turn.road_wheel_angle * car.steering_ratio;
SteadyTurn steady_turn(const SingleTrack<>& car, double ay, double vx);

/// The lateral acceleration [m/s^2] above which there is no steady turn, as the first axle has
/// reached its largest force; infinite with linear axles.
double largest_steady_acceleration(const SingleTrack<>& car);

}  // namespace identikal
