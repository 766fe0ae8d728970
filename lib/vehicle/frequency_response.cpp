#include "lib/vehicle/frequency_response.h"

namespace identikal {

FrequencyResponse frequency_response(const SingleTrack<>& car, double vx, double omega) {
  using Complex = std::complex<double>;
  const Complex s(0.0, omega);
  const Complex lag = 1.0 / (1.0 + s * (car.relaxation_length / vx));
  const Complex Cf = car.front.effective_stiffness() * lag,
                Cr = car.rear.effective_stiffness() * lag;
  const Complex delta = car.steering_gain / car.steering_ratio * std::exp(-s * car.steering_delay);
  const double a = car.a, b = car.b;
  // [p q; u v] [vy; r] = [Cf; a Cf] delta.
  const Complex p = car.m * s + (Cf + Cr) / vx, q = car.m * vx + (a * Cf - b * Cr) / vx,
                u = (a * Cf - b * Cr) / vx, v = car.Iz * s + (a * a * Cf + b * b * Cr) / vx;
  const Complex determinant = p * v - q * u;
  FrequencyResponse out;
  out.vy = Cf * delta * (v - a * q) / determinant;
  out.r = Cf * delta * (a * p - u) / determinant;
  out.ay = s * out.vy + vx * out.r;
  out.yaw_acceleration = s * out.r;
  return out;
}

}  // namespace identikal
