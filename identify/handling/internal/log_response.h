// How do a log's outputs answer to its steering, frequency by frequency (ISO 7401)?
#pragma once

#include <vector>

#include <Eigen/Core>

#include "identify/handling/internal/drive_signals.h"
#include "lib/statistics/transfer_function.h"

namespace identikal {

/// A frequency of the log is stated from this coherence on, up to this standard error of the gain
/// over the gain, and from this share of the largest power on that the rate of steering has.
inline constexpr double kLeastCoherence = 0.9, kLargestError = 0.1, kLeastPower = 1e-3;

/// Segments of the log at one speed.
struct ResponseSegments {
  std::vector<VehicleRun::Segment> segments;
  double speed = kNone;  ///< mean, weighted by the square of the steering's rate [m/s]
};

/// The segments of ten seconds and more whose mean speed is within a tenth of `speed`, or of that
/// of the segment in which the steering moves most.
/// @param speed  [m/s]; kNone: of that segment
ResponseSegments response_segments(const DriveSignals& signals, double speed);

/// Of the steering angle to one signal of the log, over these segments. Rows are averaged to about
/// twenty a second, which changes input and output alike; lines 0.15 Hz to each side count where a
/// segment is long enough for it.
/// @param frequencies  [Hz]
/// @return nothing where there is no segment or the signal is missing
std::vector<TransferFunction> log_response(const DriveSignals& signals,
                                           const ResponseSegments& segments,
                                           const Eigen::VectorXd& x,
                                           const Eigen::VectorXd& frequencies);

/// Whether the log determines that frequency: coherence and power are high enough.
/// @param frequencies  of the response [Hz]
std::vector<bool> is_excited(const std::vector<TransferFunction>& response,
                             const Eigen::VectorXd& frequencies);

}  // namespace identikal
