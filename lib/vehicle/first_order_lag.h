// What does a first-order lag make of a signal that goes evenly from sample to sample?
#pragma once

#include <cmath>

namespace identikal {

/// The exact step of T y' = x - y over a time h in which x goes evenly from `from` to `to`:
///   y1 = E y0 + (g - E) from + (1 - g) to,  E = exp(-h/T),  g = T/h (1 - E);
/// y1 = to where T is zero.
///
/// Example:
///
///     const FirstOrderLag step(0.02, 0.01);  // 20 ms, samples of 10 ms
///     double filtered = u(0, 0);
///     for (int k = 1; k < 100; ++k) filtered = step.next(filtered, u(0, k - 1), u(0, k));
class FirstOrderLag {
 public:
  /// @param lag   T >= 0 [s]
  /// @param step  h > 0 [s]
  FirstOrderLag(double lag, double step) {
    const bool none = lag < kNoLag;
    decay_ = none ? 0.0 : std::exp(-step / lag);
    mean_ = lag / step * (1.0 - decay_);
    decay_by_lag_ = none ? 0.0 : decay_ * step / (lag * lag);
    mean_by_lag_ = (1.0 - decay_) / step - (none ? 0.0 : decay_ / lag);
  }

  double decay() const { return decay_; }
  double from_weight() const { return mean_ - decay_; }
  double to_weight() const { return 1.0 - mean_; }

  double next(double y, double from, double to) const {
    return decay_ * y + from_weight() * from + to_weight() * to;
  }

  /// What the step adds to the derivative of y1 by T, besides decay() times that of y0.
  double by_lag(double y, double from, double to) const {
    return decay_by_lag_ * (y - from) + mean_by_lag_ * (from - to);
  }
  double next_by_lag(double y, double y_by_lag, double from, double to) const {
    return decay_ * y_by_lag + by_lag(y, from, to);
  }

 private:
  static constexpr double kNoLag = 1e-9;  // [s]
  double decay_, mean_, decay_by_lag_, mean_by_lag_;
};

}  // namespace identikal
