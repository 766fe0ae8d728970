#include "identify/handling/internal/step_figures.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include "identify/handling/internal/smooth_signal.h"
#include "lib/base/median.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::VectorXd;
using Value = HandlingSheet::Value;

constexpr double kBefore = 1.0, kRamp = 0.25, kHold = 1.5, kLongestHold = 5.0;  // [s]
constexpr double kHeld = 0.1;         // of the step: how far a held angle may wander
constexpr double kLeastChange = 1.0;  // of vx r [m/s^2]
constexpr double kLeastAngle = 0.05;  // of the range of the steering
constexpr double kSettled = 1.25;     // after the step [s]
constexpr double kLeastOvershoot = 0.005;
constexpr double kHidden = 0.25;  // of a time: a standard error that says nothing of it
constexpr double kOneSpeed = 0.1;
constexpr double kBeyondNoise = 3.0;  // standard errors

struct Mean {
  double value = kNone, se = kNone;
};

/// Of the samples between two moments.
Mean mean_between(const DriveSignals& s, const SteeringStep& step, const VectorXd& x, double from,
                  double to, double noise_sd) {
  double sum = 0.0, n = 0.0;
  for (Index t = step.first; t < step.first + step.rows; ++t) {
    if (s.time[t] < from || s.time[t] > to || std::isnan(x[t])) continue;
    sum += x[t];
    n += 1.0;
  }
  if (n < 1.0) return {};
  return {sum / n, noise_sd / std::sqrt(n)};
}

/// A signal at one step, from before to its steady value.
struct Rise {
  SmoothSignal smooth, wide;
  double sd;
  Mean before, steady;

  Rise(const DriveSignals& s, const SteeringStep& step, const VectorXd& x)
      : smooth(s.time.segment(step.first, step.rows), x.segment(step.first, step.rows), kOfEdges),
        wide(s.time.segment(step.first, step.rows), x.segment(step.first, step.rows), kOfPeaks),
        sd(smooth.noise_sd()) {
    before = mean_between(s, step, x, step.before_from, step.before_to, sd);
    const double from = std::max(step.middle + kSettled, step.hold_to - kHold);
    steady = mean_between(s, step, x, from, step.hold_to, sd);
  }
  double change() const { return steady.value - before.value; }
  double change_se() const { return std::hypot(steady.se, before.se); }
};

Value missing(const std::string& why) {
  Value out;
  out.why = why;
  return out;
}

Value valued(double value, double se) {
  Value out;
  out.value = value;
  out.se = se;
  return out;
}

/// The moment, after the middle of the step, at which this share of the change is reached.
Value response_time(const Rise& rise, const SteeringStep& step, double share) {
  const double level = rise.before.value + share * rise.change();
  const double sign = rise.change() > 0.0 ? 1.0 : -1.0;
  double earlier = kNone, earlier_time = kNone;
  for (Index t = 0; t < rise.smooth.rows(); ++t) {
    const double now = rise.smooth.time(t);
    if (now < step.middle - kRamp || now > step.hold_to) continue;
    const double value = sign * (rise.smooth.at(now).value - level);
    if (earlier < 0.0 && value >= 0.0) {
      const double at = earlier_time + (now - earlier_time) * earlier / (earlier - value);
      const LocalParabola there = rise.smooth.at(at);
      const double of_level = std::hypot(share * rise.steady.se, (1.0 - share) * rise.before.se);
      const double se = std::hypot(rise.sd * there.value_gain, of_level) / std::abs(there.slope);
      return valued(at - step.middle, std::hypot(se, step.middle_se));
    }
    earlier = value;
    earlier_time = now;
  }
  return missing("It does not reach 90 % of its steady value while the angle is held.");
}

struct Peak {
  Value time, overshoot;
};

Peak peak_of(const Rise& rise, const SteeringStep& step) {
  const double sign = rise.change() > 0.0 ? 1.0 : -1.0;
  double highest = -1.0, at = kNone;
  for (Index t = 0; t < rise.wide.rows(); ++t) {
    const double now = rise.wide.time(t);
    if (now < step.middle || now > step.hold_to) continue;
    const double value = sign * (rise.wide.at(now).value - rise.before.value);
    if (value > highest) {
      highest = value;
      at = now;
    }
  }
  // To where the parabola around it is highest: a row is not near enough.
  LocalParabola there = rise.wide.at(at);
  for (int i = 0; i < 8 && sign * there.curvature < 0.0; ++i) {
    at += std::clamp(-there.slope / there.curvature, -0.02, 0.02);
    there = rise.wide.at(at);
  }
  const double size = std::abs(rise.change()), over = highest / size - 1.0;
  const double value_se = std::hypot(rise.sd * there.value_gain, rise.steady.se) / size;
  const bool at_end = at > step.hold_to - 0.1 * (step.hold_to - step.middle);
  const std::string none = "The yaw rate has no peak above its steady value.";
  if (at_end || !(over > std::max(kLeastOvershoot, kBeyondNoise * value_se)) ||
      !(sign * there.curvature < 0.0)) {
    return {missing(none), missing(none)};
  }
  const double time_se = rise.sd * there.slope_gain / std::abs(there.curvature);
  const bool is_hidden = time_se > kHidden * (at - step.middle);
  return {is_hidden ? missing("The noise of the yaw rate hides when its peak is.")
                    : valued(at - step.middle, std::hypot(time_se, step.middle_se)),
          valued(over, value_se)};
}

/// All figures of one step.
StepFigures figures_of(const DriveSignals& s, const SteeringStep& step) {
  StepFigures out;
  const Rise r(s, step, s.r);
  out.ay = valued(step.vx * std::abs(r.change()), step.vx * r.change_se());
  out.response_of_r = response_time(r, step, 0.9);
  const Peak peak = peak_of(r, step);
  out.peak_of_r = peak.time;
  out.overshoot = peak.overshoot;
  const Rise ay(s, step, s.ay);
  out.response_of_ay = std::isfinite(ay.change()) ? response_time(ay, step, 0.9)
                                                  : missing("The log has no lateral acceleration.");
  const Rise beta(s, step, s.beta);
  if (!std::isfinite(beta.change())) {
    out.tb = missing("The log has neither vy nor beta.");
  } else if (!std::isfinite(peak.time.value)) {
    out.tb = missing(peak.time.why);
  } else {
    // Left and right count alike.
    const double sideslip = std::copysign(1.0, r.change()) * beta.change();
    out.tb = valued(peak.time.value * sideslip,
                    std::hypot(peak.time.se * beta.change(), peak.time.value * beta.change_se()));
  }
  return out;
}

Value mean_of(const std::vector<StepFigures>& each, Value StepFigures::*figure) {
  Value out;
  double sum = 0.0, squares = 0.0, n = 0.0;
  for (const StepFigures& one : each) {
    const Value& value = one.*figure;
    if (!std::isfinite(value.value)) {
      out.why = value.why;
      continue;
    }
    sum += value.value;
    squares += value.se * value.se;
    n += 1.0;
  }
  // What a few steps alone have is no figure of the car.
  if (2.0 * n <= static_cast<double>(each.size())) return out;
  double scatter = 0.0;
  for (const StepFigures& one : each) {
    const double value = (one.*figure).value;
    if (std::isfinite(value)) scatter += (value - sum / n) * (value - sum / n);
  }
  const double of_scatter = n > 2.0 ? std::sqrt(scatter / (n * (n - 1.0))) : 0.0;
  return valued(sum / n, std::max(std::sqrt(squares) / n, of_scatter));
}

/// Means of a signal over rows [from, to) that are there.
double mean_of_rows(const VectorXd& x, Index from, Index to) {
  double sum = 0.0, n = 0.0;
  for (Index t = from; t < to; ++t) {
    if (std::isnan(x[t])) continue;
    sum += x[t];
    n += 1.0;
  }
  return sum / n;
}

bool is_held(const VectorXd& angle, Index from, Index to, double about, double step) {
  return (angle.segment(from, to - from).array() - about).abs().maxCoeff() <=
         kHeld * std::abs(step);
}

/// The step whose middle is this row, if it is one; windows in rows.
struct Windows {
  Index before, ramp, hold;
};
bool is_step(const DriveSignals& s, Index row, const Windows& n, double least) {
  const double low = s.steering[row - n.ramp], high = s.steering[row + n.ramp];
  const double step = high - low;
  if (!(std::abs(step) >= least)) return false;
  if (std::abs(s.steering[row] - 0.5 * (low + high)) > 0.3 * std::abs(step)) return false;
  const double before = mean_of_rows(s.steering, row - n.before, row - n.ramp),
               after = mean_of_rows(s.steering, row + n.ramp, row + n.hold);
  if (!is_held(s.steering, row - n.before, row - n.ramp, before, after - before) ||
      !is_held(s.steering, row + n.ramp, row + n.hold, after, after - before)) {
    return false;
  }
  const double change = mean_of_rows(s.r, row + (n.ramp + n.hold) / 2, row + n.hold) -
                        mean_of_rows(s.r, row - n.before, row - n.ramp);
  return std::abs(change * s.vx[row]) >= kLeastChange;
}

SteeringStep step_at(const DriveSignals& s, const VehicleRun::Segment& segment, Index row,
                     const Windows& n) {
  const double before = mean_of_rows(s.steering, row - n.before, row - n.ramp),
               after = mean_of_rows(s.steering, row + n.ramp, row + n.hold);
  const double level = 0.5 * (before + after), step = after - before;
  SteeringStep out{};
  out.before_from = s.time[row - n.before];
  out.before_to = s.time[row - n.ramp];
  const Index end = segment.first + segment.rows;
  Index held = row + n.hold;
  while (held + 1 < end && s.time[held + 1] < s.time[row] + kLongestHold &&
         std::abs(s.steering[held + 1] - after) <= kHeld * std::abs(step)) {
    ++held;
  }
  out.hold_to = s.time[held];
  out.first = row - n.before;
  out.rows = held - out.first + 1;
  out.vx = mean_of_rows(s.vx, row, held + 1);
  out.middle = s.time[row];
  for (Index t = row - n.ramp; t < row + n.ramp; ++t) {
    const double here = s.steering[t] - level, next = s.steering[t + 1] - level;
    if (here * next > 0.0 || here == next) continue;
    out.middle = s.time[t] + (s.time[t + 1] - s.time[t]) * here / (here - next);
    break;
  }
  const SmoothSignal angle(s.time.segment(row - n.before, n.before + n.hold),
                           s.steering.segment(row - n.before, n.before + n.hold), kOfEdges);
  // About the ramp itself the parabola does not follow; where the angle is held, its noise shows.
  const double noise = SmoothSignal(s.time.segment(row - n.before, n.before - n.ramp),
                                    s.steering.segment(row - n.before, n.before - n.ramp), kOfEdges)
                           .noise_sd();
  out.middle_se = noise / std::max(std::abs(angle.at(out.middle).slope), 1e-9);
  return out;
}

}  // namespace

std::vector<SteeringStep> steps_in(const DriveSignals& s) {
  std::vector<SteeringStep> found;
  const auto rows = [&](double seconds) {
    return std::max<Index>(2, std::lround(seconds / s.step));
  };
  const Windows n{rows(kBefore), rows(kRamp), rows(kRamp + kHold)};
  double low = kInfinity, high = -kInfinity;
  for (const VehicleRun::Segment& segment : s.segments) {
    const auto angle = s.steering.segment(segment.first, segment.rows);
    low = std::min(low, angle.minCoeff());
    high = std::max(high, angle.maxCoeff());
  }
  for (const VehicleRun::Segment& segment : s.segments) {
    const Index end = segment.first + segment.rows - n.hold;
    for (Index row = segment.first + n.before; row < end; ++row) {
      if (!is_step(s, row, n, kLeastAngle * (high - low))) continue;
      found.push_back(step_at(s, segment, row, n));
      row += n.hold;
    }
  }
  if (found.empty()) return found;
  std::vector<double> speeds;
  for (const SteeringStep& step : found) speeds.push_back(step.vx);
  const double typical = median(speeds);
  std::erase_if(found, [&](const SteeringStep& step) {
    return std::abs(step.vx - typical) > kOneSpeed * typical;
  });
  return found;
}

StepFigures step_figures(const DriveSignals& signals, const std::vector<SteeringStep>& steps) {
  std::vector<StepFigures> each;
  for (const SteeringStep& step : steps) each.push_back(figures_of(signals, step));
  StepFigures out;
  for (const auto figure :
       {&StepFigures::ay, &StepFigures::response_of_r, &StepFigures::response_of_ay,
        &StepFigures::peak_of_r, &StepFigures::overshoot, &StepFigures::tb}) {
    out.*figure = mean_of(each, figure);
  }
  return out;
}

}  // namespace identikal
