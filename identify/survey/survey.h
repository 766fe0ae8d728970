// What is in this recording of a vehicle, what is wrong with it, and what would it determine?
// Before any fit, by kinematics alone; nothing is changed.
#pragma once

#include "identify/estimate/details.h"
#include "identify/survey/signals.h"

namespace identikal {

/// Signals, findings, and which parameters they are informative about. Kinematics (ISO 8855, small
/// angles): ay = dvy/dt + vx r, beta = vy/vx; at low lateral acceleration r follows vx delta / L
/// within a few tenths of a second.
///
/// Codes of the findings, stable: too_short, no_steering, no_speed, no_yaw_rate, dead_channel,
/// stuck_channel, swapped_channels, units_ay, units_speed, units_steering, sign_steering, sign_r,
/// sign_ay, sign_vy, clock_offset, clock_unclear, several_clocks, one_clock, held_samples,
/// outliers, reversing, standstill, spin, countersteer. A finding is "serious" where a fit would be wrong, else a
/// "warning" or a "note". Lags between signals are searched over +-5 s, or a quarter of the
/// recording where that is less.
///
/// Example:
///
///     const auto seen = survey(vehicle_signals(car, recordings));
///     for (const Finding& finding : seen.findings) std::puts(finding.text.c_str());
/// @throws std::invalid_argument for a signal with another number of times than values
VehicleSurvey survey(const VehicleSignals& signals);

}  // namespace identikal
