#include "lib/manoeuvre.h"

#include <cmath>
#include <numbers>

namespace identikal {
namespace {

/// sin(p) (1 - cos(p)) scaled to a peak of 1, over one period from `begin`; 0 outside.
double swing(double time, double begin, double period) {
  if (time <= begin || time >= begin + period) return 0.0;
  const double phase = 2.0 * std::numbers::pi * (time - begin) / period;
  return 4.0 / (3.0 * std::numbers::sqrt3) * std::sin(phase) * (1.0 - std::cos(phase));
}

}  // namespace

double steering(const SevereLaneChange& manoeuvre, double time) {
  const double back = manoeuvre.start + manoeuvre.period + manoeuvre.pause;
  return manoeuvre.amplitude *
         (swing(time, manoeuvre.start, manoeuvre.period) - swing(time, back, manoeuvre.period));
}

Eigen::VectorXd steering(const SevereLaneChange& manoeuvre, const Eigen::VectorXd& time) {
  return time.unaryExpr([&](double t) { return steering(manoeuvre, t); });
}

}  // namespace identikal
