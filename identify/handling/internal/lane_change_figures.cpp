#include "identify/handling/internal/lane_change_figures.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "identify/handling/internal/smooth_signal.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::VectorXd;
using Value = HandlingSheet::Value;

constexpr double kSwing = 1.0, kLargest = 2.0;   // of vx r [m/s^2]
constexpr double kQuiet = 1.5, kLongest = 12.0;  // [s]
constexpr double kLarge = 0.3;                   // of the largest: smaller ones are corrections
constexpr int kFewestSwings = 3, kMostSwings = 5;
constexpr double kNearest = 2.0, kFarthest = 6.0, kBack = 1.5;  // to the side [m]
constexpr double kMargin = 0.5;                                 // [s]

/// A segment of vx r to one side.
struct Swing {
  Index from, to;
  double peak;
};

std::vector<Swing> swings_of(const DriveSignals& s, const VehicleRun::Segment& segment) {
  std::vector<Swing> out;
  for (Index t = segment.first; t < segment.first + segment.rows; ++t) {
    const double ay = s.vx[t] * s.r[t];
    if (!(std::abs(ay) > kSwing)) continue;
    const bool same =
        !out.empty() && out.back().peak * ay > 0.0 && s.time[t] - s.time[out.back().to] < kQuiet;
    if (!same) {
      out.push_back({t, t, ay});
      continue;
    }
    out.back().to = t;
    if (std::abs(ay) > std::abs(out.back().peak)) out.back().peak = ay;
  }
  return out;
}

/// Swings with no quiet time in between.
std::vector<std::vector<Swing>> groups_of(const DriveSignals& s, const std::vector<Swing>& swings) {
  std::vector<std::vector<Swing>> out;
  for (const Swing& swing : swings) {
    const bool goes_on = !out.empty() && s.time[swing.from] - s.time[out.back().back().to] < kQuiet;
    if (!goes_on) out.emplace_back();
    out.back().push_back(swing);
  }
  return out;
}

/// How far the car goes to the side, largest and in the end.
struct Offset {
  double largest, last;
};
Offset offset_of(const DriveSignals& s, Index first, Index rows) {
  VectorXd heading = VectorXd::Zero(rows);
  for (Index i = 1; i < rows; ++i) {
    const double r = std::isnan(s.r[first + i]) ? 0.0 : s.r[first + i];
    heading[i] = heading[i - 1] + r * (s.time[first + i] - s.time[first + i - 1]);
  }
  const double drift = heading[rows - 1] / (s.time[first + rows - 1] - s.time[first]);
  double aside = 0.0;
  Offset out{0.0, 0.0};
  for (Index i = 1; i < rows; ++i) {
    const double straight = heading[i] - drift * (s.time[first + i] - s.time[first]);
    aside += s.vx[first + i] * straight * (s.time[first + i] - s.time[first + i - 1]);
    if (std::abs(aside) > std::abs(out.largest)) out.largest = aside;
  }
  out.last = aside;
  return out;
}

/// Swings that are no corrections; two to one side with a correction in between count once.
int large_swings(const std::vector<Swing>& swings, double least) {
  int out = 0;
  double last = 0.0;
  for (const Swing& swing : swings) {
    if (std::abs(swing.peak) < least) continue;
    if (swing.peak * last <= 0.0) ++out;
    last = swing.peak;
  }
  return out;
}

std::optional<LaneChange> lane_change_of(const DriveSignals& s, const VehicleRun::Segment& segment,
                                         const std::vector<Swing>& swings) {
  double peak = 0.0;
  for (const Swing& swing : swings) peak = std::max(peak, std::abs(swing.peak));
  const int count = large_swings(swings, kLarge * peak);
  if (peak < kLargest || count < kFewestSwings || count > kMostSwings) return std::nullopt;
  if (s.time[swings.back().to] - s.time[swings.front().from] > kLongest) return std::nullopt;
  const auto margin = static_cast<Index>(std::lround(kMargin / s.step));
  LaneChange out{};
  out.first = std::max(segment.first, swings.front().from - margin);
  const Index end = std::min(segment.first + segment.rows, swings.back().to + margin + 1);
  out.rows = end - out.first;
  const Offset offset = offset_of(s, out.first, out.rows);
  out.aside = std::abs(offset.largest);
  if (out.aside < kNearest || out.aside > kFarthest || std::abs(offset.last) > kBack) {
    return std::nullopt;
  }
  const auto entry = s.vx.segment(out.first, swings.front().from - out.first + 1);
  out.entry_speed = entry.mean();
  const double n = static_cast<double>(entry.size());
  const double squares = (entry.array() - out.entry_speed).square().sum();
  out.entry_speed_se = n > 2.0 ? std::sqrt(squares / (n * (n - 1.0))) : kNone;
  return out;
}

Value missing(const char* why) {
  Value out;
  out.why = why;
  return out;
}

/// Largest value, or slope, of the parabolas.
Value peak_of(const DriveSignals& s, const LaneChange& change, const VectorXd& x, bool slope,
              const char* why) {
  const SmoothSignal smooth(s.time.segment(change.first, change.rows),
                            x.segment(change.first, change.rows), kOfPeaks);
  Value out = missing(why);
  double largest = -1.0;
  for (Index t = 0; t < smooth.rows(); ++t) {
    const LocalParabola here = smooth.at(smooth.time(t));
    const double size = std::abs(slope ? here.slope : here.value);
    if (!(size > largest)) continue;
    largest = size;
    out.value = size;
    out.se = smooth.noise_sd() * (slope ? here.slope_gain : here.value_gain);
    out.why.clear();
  }
  return out;
}

}  // namespace

std::vector<LaneChange> lane_changes_in(const DriveSignals& signals) {
  std::vector<LaneChange> out;
  for (const VehicleRun::Segment& segment : signals.segments) {
    for (const auto& swings : groups_of(signals, swings_of(signals, segment))) {
      if (const auto found = lane_change_of(signals, segment, swings)) out.push_back(*found);
    }
  }
  return out;
}

LaneChangeFigures lane_change_figures(const DriveSignals& s, const LaneChange& change) {
  return {peak_of(s, change, s.ay, false, "The log has no lateral acceleration."),
          peak_of(s, change, s.r, false, "The log has no yaw rate."),
          peak_of(s, change, s.beta, false, "The log has neither vy nor beta."),
          peak_of(s, change, s.steering, false, ""), peak_of(s, change, s.steering, true, "")};
}

}  // namespace identikal
