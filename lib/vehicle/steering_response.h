// How does the linear car answer to steering, in the numbers that engineers compare cars by?
#pragma once

#include <cmath>

#include "lib/vehicle/single_track.h"

namespace identikal {

// Characteristic values of the linear car (Mitschke & Wallentowitz 2014, part D; Bundorf & Leffert
// 1976 for the cornering compliances). All for the road-wheel angle, whatever the steering ratio.

/// K = m (b Cr - a Cf) / (L Cf Cr) [rad/(m/s^2)], L = a + b; > 0 understeers. Equals
/// front_compliance - rear_compliance.
template <typename T>
T understeer_gradient(const SingleTrack<T>& car) {
  const T Cf = car.front.effective_stiffness(), Cr = car.rear.effective_stiffness();
  return car.m * (car.b * Cr - car.a * Cf) / ((car.a + car.b) * Cf * Cr);
}

/// Slip angle per lateral acceleration of the front axle, m b / (L Cf) [rad/(m/s^2)].
template <typename T>
T front_compliance(const SingleTrack<T>& car) {
  return car.m * car.b / ((car.a + car.b) * car.front.effective_stiffness());
}

/// The same of the rear axle, m a / (L Cr) [rad/(m/s^2)].
template <typename T>
T rear_compliance(const SingleTrack<T>& car) {
  return car.m * car.a / ((car.a + car.b) * car.rear.effective_stiffness());
}

/// sqrt(L / |K|) [m/s]: the characteristic speed of a car that understeers, the critical speed of
/// one that oversteers, where it becomes unstable. Infinite for K = 0.
template <typename T>
T characteristic_speed(const SingleTrack<T>& car) {
  using std::abs;
  using std::sqrt;
  return sqrt(T((car.a + car.b) / abs(understeer_gradient(car))));
}

/// Response to the road-wheel angle at one speed:
/// r/delta(s) = yaw_gain (1 + Tz s) / (1 + 2 zeta s/wn + s^2/wn^2).
template <typename T>
struct SteeringResponse {
  T yaw_gain;           ///< steady r / delta [1/s]
  T ay_gain;            ///< steady ay / delta [m/s^2 per rad]
  T sideslip_gain;      ///< steady beta / delta [-]
  T natural_frequency;  ///< wn [rad/s]; NaN above the critical speed
  T damping;            ///< zeta [-]
  T yaw_lead_time;      ///< Tz = m a u / (L Cr) [s]
};

/// @param u  forward speed [m/s], > 0
///
/// Example:
///
///     const SteeringResponse<double> at_60_km_h = steering_response(car, 60.0 / 3.6);
///     const double K = understeer_gradient(car) * kStandardGravity * kDegreesPerRadian;  // deg/g
template <typename T>
SteeringResponse<T> steering_response(const SingleTrack<T>& car, double u) {
  using std::sqrt;
  const T Cf = car.front.effective_stiffness(), Cr = car.rear.effective_stiffness();
  const T L = car.a + car.b;
  const T effective = L + understeer_gradient(car) * (u * u);
  const T wn_squared =
      Cf * Cr * L * L / (car.m * car.Iz * (u * u)) + (car.b * Cr - car.a * Cf) / car.Iz;
  const T decay =
      (Cf + Cr) / (car.m * u) + (car.a * car.a * Cf + car.b * car.b * Cr) / (car.Iz * u);
  SteeringResponse<T> out;
  out.yaw_gain = u / effective;
  out.ay_gain = u * u / effective;
  out.sideslip_gain = (car.b - car.m * car.a * (u * u) / (L * Cr)) / effective;
  out.natural_frequency = sqrt(wn_squared);
  out.damping = decay / (2.0 * out.natural_frequency);
  out.yaw_lead_time = car.m * car.a * u / (L * Cr);
  return out;
}

}  // namespace identikal
