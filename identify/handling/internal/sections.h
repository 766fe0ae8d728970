// What goes into each section of the sheet?
#pragma once

#include <optional>

#include "identify/estimate/handling.h"
#include "identify/handling/internal/drive_signals.h"
#include "identify/handling/internal/log_response.h"
#include "identify/handling/sheet.h"

namespace identikal {

/// The log, where there is one.
struct HandlingLog {
  VehicleRun run;
  DriveSignals signals;       ///< measured
  ResponseSegments segments;  ///< of the frequency response
};

/// ISO 4138: figures, remarks and the characteristic curve.
void add_steady_section(const KnownVehicle& car, const std::optional<HandlingLog>& log,
                        HandlingSheet& sheet);

/// ISO 7401: figures, remarks and the frequency responses at HandlingSheet::speed.
void add_transient_section(const KnownVehicle& car, const std::optional<HandlingLog>& log,
                           HandlingSheet& sheet);

/// ISO 3888.
void add_lane_change_section(const KnownVehicle& car, const std::optional<HandlingLog>& log,
                             HandlingSheet& sheet);

/// Why the log's side is blank where there is no log.
inline constexpr const char* kNoLog = "No recording was given.";

/// Of the run the segments of rows alone that these windows need, each from two seconds before.
VehicleRun around(const VehicleRun& run, const std::vector<VehicleRun::Segment>& windows);

}  // namespace identikal
