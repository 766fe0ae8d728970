// How does the linear car answer to a sine of steering?
#pragma once

#include <complex>

#include "lib/vehicle/single_track.h"

namespace identikal {

/// Complex amplitudes of the motion over that of the measured steering angle, exp(i omega t).
struct FrequencyResponse {
  std::complex<double> r;                 ///< [1/s]
  std::complex<double> vy;                ///< [m/s per rad]
  std::complex<double> ay;                ///< vy' + vx r [m/s^2 per rad]
  std::complex<double> yaw_acceleration;  ///< r' [1/s^2]
};

/// Of the car about straight driving at constant speed, in closed form. Forces that follow by the
/// relaxation length sigma are a complex stiffness, C' = C / (1 + s sigma/vx) with s = i omega:
///   m (s vy + vx r) = Ff + Fr,  Iz s r = a Ff - b Fr,
///   Ff = -Cf' ((vy + a r)/vx - delta),  Fr = -Cr' (vy - b r)/vx,
///   delta = steering_gain/steering_ratio exp(-s steering_delay) angle.
/// Source: Mitschke & Wallentowitz (2014), part D; ISO 7401.
/// @param vx     forward speed [m/s], > 0
/// @param omega  [rad/s], >= 0
///
/// Example:
///
///     const FrequencyResponse at_1_hz = frequency_response(car, 100.0 / 3.6, 6.2832);
///     std::printf("%g 1/s, %g rad\n", std::abs(at_1_hz.r), std::arg(at_1_hz.r));
FrequencyResponse frequency_response(const SingleTrack<>& car, double vx, double omega);

}  // namespace identikal
