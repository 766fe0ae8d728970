#include "lib/vehicle/late_sensor.h"

#include <algorithm>
#include <array>

#include "lib/vehicle/first_order_lag.h"

namespace identikal {
namespace {

using Eigen::Index;

/// Weights of up to four neighbours at a time t, and their derivatives by it (Lagrange).
struct Cubic {
  Index first = 0, points = 0;
  std::array<double, 4> weight{}, slope{};

  Cubic(const Eigen::VectorXd& time, Index interval, double t)
      : points(std::min<Index>(4, time.size())) {
    first = std::clamp<Index>(interval - 1, 0, time.size() - points);
    for (Index i = 0; i < points; ++i) {
      const double here = time[first + i];
      double w = 1.0, sum = 0.0;
      for (Index j = 0; j < points; ++j) {
        if (j == i) continue;
        const double away = here - time[first + j];
        w *= (t - time[first + j]) / away;
        double rest = 1.0 / away;
        for (Index k = 0; k < points; ++k) {
          if (k != i && k != j) rest *= (t - time[first + k]) / (here - time[first + k]);
        }
        sum += rest;
      }
      weight[i] = w;
      slope[i] = sum;
    }
  }
};

}  // namespace

void filter_by_lag(const Eigen::VectorXd& time, double lag, SignalRows& x, Index by_lag) {
  if (!(lag > 0.0) && by_lag < 0) return;
  Eigen::RowVectorXd from = x.row(0), to;
  for (Index k = 1; k < x.rows(); ++k) {
    const FirstOrderLag step(lag, time[k] - time[k - 1]);
    const double before = x(k - 1, 0);
    to = x.row(k);
    x.row(k) = step.decay() * x.row(k - 1) + step.from_weight() * from + step.to_weight() * to;
    if (by_lag >= 0) x(k, by_lag) += step.by_lag(before, from[0], to[0]);
    from.swap(to);
  }
}

SignalRows late(const Eigen::VectorXd& time, const SignalRows& y, const Eigen::VectorXd& at,
                double delay, Index by_delay) {
  SignalRows out = SignalRows::Zero(at.size(), y.cols());
  const Index N = time.size();
  Index interval = 0;
  for (Index k = 0; k < at.size(); ++k) {
    const double t = at[k] - delay;
    if (t <= time[0] || t >= time[N - 1]) {
      out.row(k) = y.row(t <= time[0] ? 0 : N - 1);
      continue;
    }
    while (interval + 2 < N && time[interval + 1] <= t) ++interval;
    const Cubic cubic(time, interval, t);
    for (Index i = 0; i < cubic.points; ++i) {
      out.row(k) += cubic.weight[i] * y.row(cubic.first + i);
    }
    if (by_delay < 0) continue;
    for (Index i = 0; i < cubic.points; ++i) {
      out(k, by_delay) -= cubic.slope[i] * y(cubic.first + i, 0);
    }
  }
  return out;
}

}  // namespace identikal
