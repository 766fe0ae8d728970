#include "identify/handling/internal/log_response.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "lib/base/interpolation.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kLeastSeconds = 10.0;
constexpr double kRate = 20.0;       // [Hz]
constexpr double kHalfWidth = 0.15;  // [Hz]
constexpr double kMissing = 0.05;    // share of the samples

/// The rows evenly spaced, gaps bridged; nothing where too much is missing.
std::optional<VectorXd> even(const DriveSignals& s, const VehicleRun::Segment& segment,
                             const VectorXd& x) {
  const VectorXd time = s.time.segment(segment.first, segment.rows),
                 values = x.segment(segment.first, segment.rows);
  const double missing = static_cast<double>(values.array().isNaN().count());
  if (missing > kMissing * static_cast<double>(segment.rows)) return std::nullopt;
  const double seconds = time[segment.rows - 1] - time[0];
  const VectorXd apart = time.tail(segment.rows - 1) - time.head(segment.rows - 1);
  const bool uniform = missing == 0.0 && apart.maxCoeff() < 1.5 * s.step;
  if (uniform) return values;
  const auto N = static_cast<Index>(seconds / s.step) + 1;
  const VectorXd at =
      VectorXd::LinSpaced(N, time[0], time[0] + static_cast<double>(N - 1) * s.step);
  const VectorXd out = interpolate_linearly(time, values, at, kInfinity);
  // At the ends nothing is extrapolated.
  if (!out.allFinite()) return std::nullopt;
  return out;
}

/// Means of `every` rows each.
VectorXd thinned(const VectorXd& x, Index every) {
  const Index n = x.size() / every;
  return Eigen::Map<const MatrixXd>(x.data(), every, n).colwise().mean();
}

}  // namespace

ResponseSegments response_segments(const DriveSignals& s, double speed) {
  constexpr double kOneSpeed = 0.1;
  struct Segment {
    VehicleRun::Segment segment;
    double power, speed, weighted;  // of the steering's rate; mean of vx; power times vx
  };
  std::vector<Segment> all;
  double largest = 0.0;
  for (const VehicleRun::Segment& segment : s.segments) {
    if (static_cast<double>(segment.rows) * s.step < kLeastSeconds) continue;
    const auto angle = s.steering.segment(segment.first, segment.rows),
               vx = s.vx.segment(segment.first, segment.rows);
    const Eigen::ArrayXd moved =
        (angle.tail(segment.rows - 1) - angle.head(segment.rows - 1)).array().square();
    all.push_back(
        {segment, moved.sum(), vx.mean(), (moved * vx.tail(segment.rows - 1).array()).sum()});
    if (!(all.back().power > largest)) continue;
    largest = all.back().power;
  }
  ResponseSegments out;
  for (const Segment& each : all) {
    if (std::isnan(speed) && each.power == largest) speed = each.speed;
  }
  double power = 0.0, weighted = 0.0;
  for (const Segment& each : all) {
    if (std::abs(each.speed - speed) > kOneSpeed * speed) continue;
    out.segments.push_back(each.segment);
    power += each.power;
    weighted += each.weighted;
  }
  if (power > 0.0) out.speed = weighted / power;
  return out;
}

std::vector<TransferFunction> log_response(const DriveSignals& signals,
                                           const ResponseSegments& segments, const VectorXd& x,
                                           const VectorXd& frequencies) {
  const Index every = std::max<Index>(1, std::lround(1.0 / (kRate * signals.step)));
  const double step = signals.step * static_cast<double>(every);
  std::vector<MatrixXd> records;
  for (const VehicleRun::Segment& segment : segments.segments) {
    const auto input = even(signals, segment, signals.steering), output = even(signals, segment, x);
    if (!input || !output) continue;
    MatrixXd record(2, std::min(input->size(), output->size()) / every);
    if (record.cols() < 16) continue;
    record.row(0) = thinned(*input, every).head(record.cols()).transpose();
    record.row(1) = thinned(*output, every).head(record.cols()).transpose();
    records.push_back(std::move(record));
  }
  if (records.empty()) return {};
  return transfer_function(records, step, frequencies, kHalfWidth);
}

std::vector<bool> is_excited(const std::vector<TransferFunction>& response,
                             const VectorXd& frequencies) {
  // Of the rate of the steering: most of a drive's angle is slow.
  const auto power = [&](Index i) {
    return frequencies[i] * frequencies[i] * response[i].input_power;
  };
  double largest = 0.0;
  for (Index i = 0; i < frequencies.size(); ++i) largest = std::max(largest, power(i));
  std::vector<bool> out;
  for (Index i = 0; i < frequencies.size(); ++i) {
    out.push_back(response[i].coherence >= kLeastCoherence &&
                  response[i].relative_se <= kLargestError && power(i) >= kLeastPower * largest);
  }
  return out;
}

}  // namespace identikal
