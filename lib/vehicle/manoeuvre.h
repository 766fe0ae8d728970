// What does the driver do? Steering and speed of standard manoeuvres that are driven open loop.
// Those that need a driver on a course: lib/vehicle/lane_change.h.
#pragma once

#include <Eigen/Core>

#include "lib/vehicle/single_track.h"

namespace identikal {

/// Open-loop severe lane change (obstacle avoidance, after ISO 3888-2): a swing of steering out of
/// the lane, a pause, and the mirrored swing back. Each swing is a sine under a Hann window,
///   amplitude * 4/(3 sqrt 3) * sin(p) (1 - cos(p)),  p = 2 pi (t - begin) / period,
/// whose first and second derivatives are continuous everywhere, so that a recording at 10 Hz still
/// holds what happened between its samples. The defaults suit a passenger car at 60 km/h with a
/// steering ratio of about 20: about one lane (3 to 3.5 m) to the side, about 6 m/s^2 at the peak.
struct SevereLaneChange {
  double amplitude = 1.87;  ///< peak steering-wheel angle [rad], positive to the left (ISO 8855)
  double start = 0.5;       ///< begin of the first swing [s]
  double period = 2.25;     ///< duration of each swing [s]
  double pause = 0.6;       ///< between the swings [s]
};

/// Step of steering, ISO 7401: straight, then as fast as can be to an angle that is held. The rise
/// is half a cosine, with a continuous first derivative; ISO 7401 wants 10 to 90 % of the angle
/// within 0.15 s, which this passes in 0.59 `rise`.
struct StepSteer {
  double amplitude = 0.0;  ///< angle held [rad]
  double start = 1.0;      ///< begin of the rise [s]
  double rise = 0.2;       ///< its duration [s]
};

/// Periods of a sine, straight before and after: ISO 7401 (one period of 0.5 Hz) and the weave test
/// of ISO 13674-1 (0.2 Hz, many periods). As in the standards its slope jumps at begin and end.
struct SineSteer {
  double amplitude = 0.0;  ///< [rad]
  double start = 1.0;      ///< [s]
  double frequency = 0.5;  ///< [Hz]
  double periods = 1.0;    ///< whole numbers end at zero
};

/// Sweep of frequencies at one amplitude, ISO 7401: a sine whose frequency rises linearly in time.
/// It is faded in and out by half a cosine, so that its first derivative is continuous.
struct SweepSteer {
  double amplitude = 0.0;  ///< [rad]
  double start = 1.0;      ///< [s]
  double duration = 40.0;  ///< [s]
  double from = 0.1;       ///< frequency at its begin [Hz]
  double to = 3.0;         ///< and at its end [Hz]
  double fade = 1.0;       ///< at both ends [s]
};

/// Sine with dwell, ISO 19365 (the stability test of FMVSS 126 and UN R140): one period of a sine,
/// held for a while at its second peak, three quarters through.
struct SineWithDwell {
  double amplitude = 0.0;  ///< [rad]
  double start = 1.0;      ///< [s]
  double frequency = 0.7;  ///< [Hz]
  double dwell = 0.5;      ///< how long the second peak is held [s]
};

/// Steering-wheel angle [rad] at time [s].
double steering(const SevereLaneChange& manoeuvre, double time);
double steering(const StepSteer& manoeuvre, double time);
double steering(const SineSteer& manoeuvre, double time);
double steering(const SweepSteer& manoeuvre, double time);
double steering(const SineWithDwell& manoeuvre, double time);

/// Steering-wheel angle [rad] at each time [s].
///
/// Example:
///
///     const Eigen::VectorXd wheel = steering(SevereLaneChange{}, time);
///     const double held = car.steering_ratio * road_wheel_angle(car, 100.0, 20.0);  // 20 m/s
///     const Eigen::VectorXd step = steering(StepSteer{.amplitude = held}, time);
template <typename Manoeuvre>
Eigen::VectorXd steering(const Manoeuvre& manoeuvre, const Eigen::VectorXd& time) {
  return time.unaryExpr([&](double t) { return steering(manoeuvre, t); });
}

/// Speed that rises so slowly that every moment is nearly steady, ISO 4138: on a circle of this
/// radius the lateral acceleration would rise evenly,
///   vx^2 = start_speed^2 + radius * rise * time.
struct SteadyCircle {
  double radius = 100.0;            ///< that of ISO 4138 [m]
  double start_speed = 30.0 / 3.6;  ///< [m/s]
  double rise = 0.1;                ///< of the lateral acceleration [m/s^3]
};

/// Forward speed [m/s] at time [s].
double speed(const SteadyCircle& circle, double time);

/// Road-wheel angle [rad] at which the car, at this steady speed, drives on a circle to the left:
///   delta = (L + K vx^2) / radius
/// (L wheelbase, K understeer gradient; linear axles, no bank). With radius = vx^2 / ay it is the
/// angle of a lateral acceleration.
/// @param radius  [m]; @param vx  [m/s]
double road_wheel_angle(const SingleTrack<>& car, double radius, double vx);

}  // namespace identikal
