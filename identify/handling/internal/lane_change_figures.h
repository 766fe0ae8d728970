// How hard was a double lane change (ISO 3888)?
#pragma once

#include <vector>

#include "identify/estimate/handling.h"
#include "identify/handling/internal/drive_signals.h"

namespace identikal {

/// A drive out of the lane and back: three to five swings of vx r to alternating sides (those of less
/// than 30 % of the largest are corrections), the largest above 2 m/s^2, within 12 s, that lead 2 to 6 m to the side and back within 1.5 m.
struct LaneChange {
  Eigen::Index first, rows;  ///< half a second more at either end
  double entry_speed;        ///< mean of the half second before the first swing [m/s]
  double entry_speed_se;     ///< [m/s]
  double aside;              ///< how far it led to the side [m]
};

/// Headings are integrated from the yaw rate and taken as equal at begin and end.
std::vector<LaneChange> lane_changes_in(const DriveSignals& signals);

/// Largest sizes, SI.
struct LaneChangeFigures {
  HandlingSheet::Value ay, r, beta, steering, steering_rate;
};
LaneChangeFigures lane_change_figures(const DriveSignals& signals, const LaneChange& change);

}  // namespace identikal
