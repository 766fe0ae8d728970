#include "lib/vehicle/spin.h"

#include <algorithm>
#include <cmath>

#include "lib/base/constants.h"

namespace identikal {
namespace {

using Eigen::Index;

constexpr double kSideways = 25.0 / kDegreesPerRadian;  // no driver holds a car there
constexpr double kSliding = 12.0 / kDegreesPerRadian;   // tyres are beyond their grip
constexpr double kStraight = 6.0 / kDegreesPerRadian;
constexpr double kSidewaysFor = 0.2, kAgainstFor = 0.5, kStraightFor = 0.5;  // [s]
constexpr double kSlowest = 3.0;                                             // [m/s]
constexpr double kTurning = 3.0;  // [m/s^2] of vx |r|, for steering against it to mean anything
constexpr double kTurningHard = 6.0, kGentleTurning = 1.5;  // [m/s^2]
constexpr double kTurningNoMore = 2.0;
constexpr double kSoftTyre = 10.0;     // cornering stiffness over load [1/rad]
constexpr double kShortestHold = 0.3;  // [s]
constexpr double kWith = 0.7;  // share of the turning before, in which the driver steered with it

/// What a row says of itself.
struct Row {
  double sideslip = kNaN;  // size [rad]
  double turning = kNaN;   // vx |r| [m/s^2], of the speed over ground
  int side = 0;            // 1: the driver steers with the yaw rate, -1: against it

  bool against(double least) const { return side < 0 && turning > least; }
};

std::vector<Row> rows_of(const SpinSignals& s) {
  const Index N = s.time.size();
  double widest = 0.0;
  for (Index k = 0; k < N; ++k) {
    if (std::isfinite(s.steering[k])) widest = std::max(widest, std::abs(s.steering[k]));
  }
  std::vector<Row> out(static_cast<std::size_t>(N));
  for (Index k = 0; k < N; ++k) {
    Row& row = out[k];
    double speed = std::abs(s.vx[k]);
    if (s.vy.size() > 0 && std::isfinite(s.vy[k]) && std::isfinite(speed)) {
      speed = std::hypot(s.vx[k], s.vy[k]);
      if (speed > kSlowest) row.sideslip = std::abs(std::atan2(s.vy[k], s.vx[k]));
    }
    row.turning = speed * std::abs(s.r[k]);
    if (!(std::abs(s.steering[k]) > 0.02 * widest)) continue;
    row.side = s.steering[k] * s.r[k] < 0.0 ? -1 : 1;
  }
  return out;
}

/// Whether the driver steered with the turns before row k, so that the signs are right.
/// @param least  of the turns [m/s^2]
bool steered_with(const std::vector<Row>& rows, Index k, double least) {
  Index with = 0, against = 0;
  for (Index i = 0; i < k; ++i) {
    if (!(rows[i].turning > least)) continue;
    with += rows[i].side > 0 ? 1 : 0;
    against += rows[i].side < 0 ? 1 : 0;
  }
  return with > 0 && static_cast<double>(with) >= kWith * static_cast<double>(with + against);
}

/// Length of the run of rows from k on that satisfy it [s].
template <typename Holds>
double length_of_run(const Eigen::VectorXd& time, const std::vector<Row>& rows, Index k,
                     const Holds& holds, Index& end) {
  end = k;
  while (end < time.size() && holds(rows[end])) ++end;
  return end > k ? time[end - 1] - time[k] : 0.0;
}

bool is_complete(const SpinSignals& s) {
  const Index N = s.time.size();
  return s.steering.size() == N && s.r.size() == N && s.vx.size() == N;
}

Index end_of(const Eigen::VectorXd& time, const std::vector<Row>& rows, Index k) {
  const auto settled = [](const Row& row) {
    return row.turning < kTurningNoMore && !(row.sideslip > kStraight);
  };
  for (Index end; k < time.size(); k = std::max(k + 1, end)) {
    if (length_of_run(time, rows, k, settled, end) > kStraightFor) return k;
  }
  return time.size();
}

}  // namespace

std::vector<Spin> find_spins(const SpinSignals& signals) {
  const Eigen::VectorXd& time = signals.time;
  std::vector<Spin> out;
  if (!is_complete(signals)) return out;
  const std::vector<Row> rows = rows_of(signals);
  const auto sideways = [](const Row& row) { return row.sideslip > kSideways; };
  const auto against = [](const Row& row) { return row.against(kTurningHard); };
  Index free_from = 0;
  for (Index k = 0; k < time.size(); ++k) {
    Index end;
    const bool by_sideslip = length_of_run(time, rows, k, sideways, end) > kSidewaysFor;
    const bool by_steering = signals.vy.size() == 0 && !by_sideslip &&
                             length_of_run(time, rows, k, against, end) > kAgainstFor &&
                             steered_with(rows, k, kTurning);
    if (!by_sideslip && !by_steering) continue;
    Spin spin;
    spin.first = k;
    while (spin.first > free_from &&
           (rows[spin.first - 1].against(kTurning) || rows[spin.first - 1].sideslip > kSliding)) {
      --spin.first;
    }
    const Index last = end_of(time, rows, end);
    spin.rows = last - spin.first;
    spin.sideslip = signals.vy.size() > 0 ? 0.0 : kNaN;
    for (Index i = spin.first; i < last; ++i) {
      if (rows[i].sideslip > spin.sideslip) spin.sideslip = rows[i].sideslip;
    }
    out.push_back(spin);
    k = free_from = last;
  }
  return out;
}

std::vector<Spin> find_countersteering(const SpinSignals& signals, const std::vector<Spin>& spins) {
  const Eigen::VectorXd& time = signals.time;
  std::vector<Spin> out;
  if (!is_complete(signals)) return out;
  std::vector<Row> rows = rows_of(signals);
  for (const Spin& spin : spins) {
    for (Index k = spin.first; k < spin.first + spin.rows; ++k) rows[k] = {};
  }
  const auto against = [](const Row& row) { return row.against(kTurning); };
  Index end = 0;
  for (Index k = 0; k < time.size(); k = std::max(k + 1, end)) {
    const double seconds = length_of_run(time, rows, k, against, end);
    if (end == k) continue;
    const double answer = std::abs(signals.vx[k]) / (kSoftTyre * kStandardGravity);
    if (!(seconds > std::max(kShortestHold, 2.0 * answer)) ||
        !steered_with(rows, k, kGentleTurning)) {
      continue;
    }
    Spin slide{k, end - k, signals.vy.size() > 0 ? 0.0 : kNaN};
    for (Index i = k; i < end; ++i) {
      if (rows[i].sideslip > slide.sideslip) slide.sideslip = rows[i].sideslip;
    }
    if (!(slide.sideslip <= kStraight)) out.push_back(slide);
  }
  return out;
}

}  // namespace identikal
