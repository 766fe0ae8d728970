// What does a log tell of the car's steady turning (ISO 4138)?
#pragma once

#include <vector>

#include <Eigen/Core>

#include "identify/estimate/handling.h"
#include "identify/handling/internal/drive_signals.h"
#include "lib/vehicle/single_track.h"

namespace identikal {

/// A second of quasi-steady driving: means.
struct SteadySecond {
  double angle;     ///< road-wheel angle by gain, offset and ratio of the car [rad]
  double steering;  ///< as measured, offset added [rad]
  double vx;        ///< [m/s]
  double r;         ///< [rad/s]
  double beta;      ///< [rad]; NaN: not measured
  double ay_se;     ///< of the mean of vx r, by the noise of its rows [m/s^2]
  double ay() const { return vx * r; }
};

/// Seconds in which, from one half to the other, vx r changes by less than 0.3 m/s^2 in a second,
/// the steering by as much of its own size, and the speed by less than 1 m/s^2.
std::vector<SteadySecond> steady_seconds(const DriveSignals& signals, const SingleTrack<>& car);

/// y = c + slope x by least squares, and with `aside` a third term that is no part of the answer. Errors that are alike from second to second count as fewer:
/// the squares are those of n/f samples with f = 1 + 2 sum rho_k the integrated autocorrelation of
/// the residuals, summed until it is no longer positive.
struct SteadyLine {
  double slope = kNone, slope_se = kNone, offset = kNone;
  double sd = kNone;         ///< of the residuals
  double correlation = 1.0;  ///< f
  double freedom = kNone;    ///< n/f less the terms
};
SteadyLine steady_line(const Eigen::VectorXd& x, const Eigen::VectorXd& y,
                       const Eigen::VectorXd& aside = {});

/// Up to here tyres are taken as linear [m/s^2].
inline constexpr double kLinearAcceleration = 4.0;

/// What stands against a regression over these seconds: a sentence, or nothing.
std::string too_little_turning(const std::vector<SteadySecond>& seconds);

/// The seconds up to kLinearAcceleration.
std::vector<SteadySecond> linear_seconds(const std::vector<SteadySecond>& seconds);

// Biases of the sensors: that of the angle is part of the line's offset; those of yaw rate and vy
// make an error over vx, which is a term of its own where the speeds differ by a fifth or more.

/// angle - L r/vx over vx r: the slope is K [rad/(m/s^2)] whatever radius and speed.
SteadyLine understeer_line(const std::vector<SteadySecond>& seconds, double wheelbase);

/// beta - b r/vx over vx r: the slope is minus the compliance of the rear axle [rad/(m/s^2)].
SteadyLine sideslip_line(const std::vector<SteadySecond>& seconds, double b);

}  // namespace identikal
