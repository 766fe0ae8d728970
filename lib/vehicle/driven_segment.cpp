#include "lib/vehicle/driven_segment.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "lib/base/interpolation.h"
#include "lib/base/message.h"
#include "lib/vehicle/first_order_lag.h"

namespace identikal {
namespace {

// Largest step in units of the fastest time constant. One Runge-Kutta step of this length errs by
// about 0.35^5 / 120 = 4e-5 of a mode that has already decayed to 70 % within it.
constexpr double kStepPerTimeConstant = 0.35;
// The same for the lag of the forces, which is fed smoothly.
constexpr double kStepPerRelaxation = 0.7;

/// The wheels follow the angle by a first-order lag. Between nodes the angle goes evenly.
void filter_steering(DrivenSegment& segment, double lag) {
  segment.lag = lag;
  std::size_t at = 0;
  double from = segment.nodes[0].steering, rate_from = segment.nodes[0].steering_rate;
  segment.nodes[0].steering_by_lag = 0.0;
  for (const DrivenSegment::Interval& interval : segment.intervals) {
    const FirstOrderLag step(lag, 0.5 * interval.step);
    for (int half = 0; half < 2 * interval.steps; ++half, ++at) {
      const DrivenSegment::Node& before = segment.nodes[at];
      DrivenSegment::Node& now = segment.nodes[at + 1];
      const double to = now.steering, rate_to = now.steering_rate;
      now.steering = step.next(before.steering, from, to);
      now.steering_rate = step.next(before.steering_rate, rate_from, rate_to);
      now.steering_by_lag = step.next_by_lag(before.steering, before.steering_by_lag, from, to);
      from = to;
      rate_from = rate_to;
    }
  }
}

/// Slope at every sample of the straight line through those within kSlopeReach, and at least its
/// neighbours: noise of a sensor would be all that a difference shows.
Eigen::VectorXd local_slopes(const Eigen::VectorXd& time, const Eigen::VectorXd& x) {
  constexpr double kSlopeReach = 0.04;  // [s]
  const Eigen::Index N = time.size();
  Eigen::VectorXd out(N);
  Eigen::Index first = 0, last = 0;
  for (Eigen::Index k = 0; k < N; ++k) {
    while (time[k] - time[first] > kSlopeReach + 1e-9) ++first;
    while (last + 1 < N && time[last + 1] - time[k] <= kSlopeReach + 1e-9) ++last;
    const Eigen::Index from = std::max<Eigen::Index>(0, std::min(first, k - 1));
    const Eigen::Index rows = std::min(N - 1, std::max(last, k + 1)) - from + 1;
    const auto t = time.segment(from, rows), values = x.segment(from, rows);
    const Eigen::VectorXd centred = t.array() - t.mean();
    out[k] = centred.dot(values) / centred.squaredNorm();
  }
  return out;
}

}  // namespace

DrivenSegment drive(const Eigen::VectorXd& time, const Eigen::VectorXd& steering,
                    const Eigen::VectorXd& vx, const IntegrationDemand& demand, double delay,
                    double lag) {
  const Eigen::Index n = time.size();
  if (n < 2 || steering.size() != n || vx.size() != n || !(vx.minCoeff() > 0.0)) {
    const std::string smallest =
        vx.size() > 0 ? message({" (smallest ", vx.minCoeff(), " m/s)"}) : std::string();
    throw std::invalid_argument(message({"drive: ", n, " time stamps, ", steering.size(),
                                         " steering angles, ", vx.size(), " speeds", smallest}));
  }
  const Pchip vx_at(time, vx);
  DrivenSegment out;
  out.intervals.reserve(static_cast<std::size_t>(n - 1));
  const auto add_node = [&](Eigen::Index k, double t) {
    const double speed = vx_at.in_interval(k, t);
    out.nodes.push_back({.steering = 0.0,
                         .vx = speed,
                         .inverse_vx = 1.0 / speed,
                         .vx_rate = vx_at.slope_in_interval(k, t)});
  };
  std::size_t steps_in_all = 0;
  for (Eigen::Index k = 0; k + 1 < n; ++k) {
    const double length = time[k + 1] - time[k];
    const double slowest = std::min(vx[k], vx[k + 1]), fastest = std::max(vx[k], vx[k + 1]);
    double limit =
        std::min(demand.longest_step, kStepPerTimeConstant * slowest / demand.decay_rate);
    if (demand.relaxation_length > 0.0) {
      limit = std::min(limit, kStepPerRelaxation * demand.relaxation_length / fastest);
    }
    // A step that is too long by rounding only is not worth a second one.
    const int steps = std::max(1, static_cast<int>(std::ceil(length / limit - 1e-6)));
    out.intervals.push_back({steps, length / steps});
    steps_in_all += static_cast<std::size_t>(steps);
  }
  out.nodes.reserve(2 * steps_in_all + 1);
  add_node(0, time[0]);
  for (Eigen::Index k = 0; k + 1 < n; ++k) {
    const auto [steps, step] = out.intervals[static_cast<std::size_t>(k)];
    for (int half = 1; half < 2 * steps; ++half) add_node(k, time[k] + 0.5 * half * step);
    add_node(k, time[k + 1]);
  }
  set_delay(out, time, steering, delay, lag);
  return out;
}

void set_delay(DrivenSegment& segment, const Eigen::VectorXd& time, const Eigen::VectorXd& steering,
               double delay, double lag) {
  const Pchip steering_at(time, steering);
  const Eigen::Index n = time.size();
  segment.delay = delay;
  Eigen::Index from = 0;  // interval that holds the time to read at
  const auto read = [&](DrivenSegment::Node& node, double t) {
    if (t < time[0] || t > time[n - 1]) {
      node.steering = steering[t < time[0] ? 0 : n - 1];
      node.steering_rate = 0.0;
      return;
    }
    while (from + 2 < n && time[from + 1] < t) ++from;
    node.steering = steering_at.in_interval(from, t);
    node.steering_rate = steering_at.slope_in_interval(from, t);
  };
  std::size_t at = 0;
  read(segment.nodes[at++], time[0] - delay);
  for (Eigen::Index k = 0; k + 1 < n; ++k) {
    const DrivenSegment::Interval& interval = segment.intervals[k];
    for (int half = 1; half < 2 * interval.steps; ++half) {
      read(segment.nodes[at++], time[k] + 0.5 * half * interval.step - delay);
    }
    read(segment.nodes[at++], time[k + 1] - delay);
  }
  filter_steering(segment, lag);
}

void set_roll(DrivenSegment& segment, const Eigen::VectorXd& time, const Eigen::VectorXd& roll) {
  const Pchip roll_at(time, roll), rate_at(time, local_slopes(time, roll));
  std::size_t at = 0;
  const auto read = [&](Eigen::Index k, double t) {
    segment.nodes[at].roll = roll_at.in_interval(k, t);
    segment.nodes[at++].roll_rate = rate_at.in_interval(k, t);
  };
  read(0, time[0]);
  for (Eigen::Index k = 0; k + 1 < time.size(); ++k) {
    const DrivenSegment::Interval& interval = segment.intervals[k];
    for (int half = 1; half < 2 * interval.steps; ++half) {
      read(k, time[k] + 0.5 * half * interval.step);
    }
    read(k, time[k + 1]);
  }
}

DrivenSegment with_every_step(const DrivenSegment& segment) {
  DrivenSegment out = segment;
  out.intervals.clear();
  for (const DrivenSegment::Interval& interval : segment.intervals) {
    out.intervals.insert(out.intervals.end(), static_cast<std::size_t>(interval.steps),
                         {1, interval.step});
  }
  return out;
}

Eigen::VectorXd times_of_steps(const DrivenSegment& segment, const Eigen::VectorXd& time) {
  Eigen::VectorXd out((static_cast<Eigen::Index>(segment.nodes.size()) + 1) / 2);
  Eigen::Index at = 0;
  for (std::size_t k = 0; k < segment.intervals.size(); ++k) {
    const DrivenSegment::Interval& interval = segment.intervals[k];
    for (int step = 0; step < interval.steps; ++step) {
      out[at++] = time[static_cast<Eigen::Index>(k)] + step * interval.step;
    }
  }
  out[at] = time[time.size() - 1];
  return out;
}

}  // namespace identikal
