// What does the driver do? Steering inputs of standard manoeuvres.
#pragma once

#include <Eigen/Core>

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

/// Steering-wheel angle [rad] at time [s].
double steering(const SevereLaneChange& manoeuvre, double time);

/// Steering-wheel angle [rad] at each time [s].
Eigen::VectorXd steering(const SevereLaneChange& manoeuvre, const Eigen::VectorXd& time);

}  // namespace identikal
