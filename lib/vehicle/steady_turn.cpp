#include "lib/vehicle/steady_turn.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace identikal {
namespace {

/// Where the curve has risen to this force, by bisection of the linear force L.
double rising_to(const AxleCurve& curve, double force) {
  const double C = curve.axle().stiffness;
  constexpr double kStep = 1.05;
  double low = 0.0, high = force, reached = curve.force(-high / C);
  while (reached < force) {
    low = high;
    high *= kStep;
    const double next = curve.force(-high / C);
    if (next <= reached) return kNaN;  // past its peak
    reached = next;
  }
  for (int i = 0; i < 80; ++i) {
    const double middle = 0.5 * (low + high);
    (curve.force(-middle / C) < force ? low : high) = middle;
  }
  return -0.5 * (low + high) / C;
}

}  // namespace

double slip_angle_at(const Axle<>& given, double force) {
  if (given.compliance != 0.0) {
    Axle<> stiff = given;
    stiff.compliance = 0.0;
    return slip_angle_at(stiff, force) - given.compliance * force;
  }
  const Axle<>& axle = given;
  if (axle.curve == TyreCurve::linear || axle.softening <= 0.0 || force == 0.0) {
    return -force / axle.stiffness;
  }
  const double root = std::sqrt(axle.softening);
  if (axle.curve == TyreCurve::tanh) {
    return std::abs(force) * root < 1.0 ? -std::atanh(force * root) / (root * axle.stiffness)
                                        : kNaN;
  }
  return std::copysign(rising_to(AxleCurve(axle), std::abs(force)), -force);
}

double largest_force(const Axle<>& axle) {
  if (axle.curve == TyreCurve::linear || axle.softening <= 0.0) return kInfinity;
  const double D = 1.0 / std::sqrt(axle.softening);
  if (axle.curve != TyreCurve::magic_formula || axle.shape >= 1.0) return D;
  return D * std::sin(axle.shape * std::numbers::pi / 2.0);
}

SteadyTurn steady_turn(const SingleTrack<>& given, double ay, double vx) {
  const SingleTrack<> car = with_load_transfer(given, ay);
  const double L = car.a + car.b, curvature = ay / (vx * vx);
  const double front = slip_angle_at(car.front, car.m * ay * car.b / L),
               rear = slip_angle_at(car.rear, car.m * ay * car.a / L);
  return {L * curvature - front + rear, car.b * curvature + rear};
}

double largest_steady_acceleration(const SingleTrack<>& car) {
  const double L = car.a + car.b;
  return std::min(largest_force(car.front) * L / (car.m * car.b),
                  largest_force(car.rear) * L / (car.m * car.a));
}

}  // namespace identikal
