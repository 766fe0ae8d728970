#include "lib/vehicle/manoeuvre.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "lib/vehicle/steering_response.h"

namespace identikal {
namespace {

constexpr double kTurn = 2.0 * std::numbers::pi;

/// sin(p) (1 - cos(p)) scaled to a peak of 1, over one period from `begin`; 0 outside.
double swing(double time, double begin, double period) {
  if (time <= begin || time >= begin + period) return 0.0;
  const double phase = kTurn * (time - begin) / period;
  return 4.0 / (3.0 * std::numbers::sqrt3) * std::sin(phase) * (1.0 - std::cos(phase));
}

/// From 0 to 1 along half a cosine while `share` goes from 0 to 1.
double eased(double share) {
  return 0.5 - 0.5 * std::cos(std::numbers::pi * std::clamp(share, 0.0, 1.0));
}

}  // namespace

double steering(const SevereLaneChange& manoeuvre, double time) {
  const double back = manoeuvre.start + manoeuvre.period + manoeuvre.pause;
  return manoeuvre.amplitude *
         (swing(time, manoeuvre.start, manoeuvre.period) - swing(time, back, manoeuvre.period));
}

double steering(const StepSteer& manoeuvre, double time) {
  return manoeuvre.amplitude * eased((time - manoeuvre.start) / manoeuvre.rise);
}

double steering(const SineSteer& manoeuvre, double time) {
  const double cycles = (time - manoeuvre.start) * manoeuvre.frequency;
  if (cycles <= 0.0 || cycles >= manoeuvre.periods) return 0.0;
  return manoeuvre.amplitude * std::sin(kTurn * cycles);
}

double steering(const SweepSteer& manoeuvre, double time) {
  const double t = time - manoeuvre.start, left = manoeuvre.duration - t;
  if (t <= 0.0 || left <= 0.0) return 0.0;
  const double rise = (manoeuvre.to - manoeuvre.from) / manoeuvre.duration;
  const double cycles = (manoeuvre.from + 0.5 * rise * t) * t;
  return manoeuvre.amplitude * eased(std::min(t, left) / manoeuvre.fade) * std::sin(kTurn * cycles);
}

double steering(const SineWithDwell& manoeuvre, double time) {
  const double peak = 0.75 / manoeuvre.frequency, t = time - manoeuvre.start;
  const double moving = t - std::clamp(t - peak, 0.0, manoeuvre.dwell);  // the dwell taken out
  return steering(SineSteer{manoeuvre.amplitude, 0.0, manoeuvre.frequency, 1.0}, moving);
}

double speed(const SteadyCircle& circle, double time) {
  return std::sqrt(circle.start_speed * circle.start_speed + circle.radius * circle.rise * time);
}

double road_wheel_angle(const SingleTrack<>& car, double radius, double vx) {
  return (car.a + car.b + understeer_gradient(car) * vx * vx) / radius;
}

}  // namespace identikal
