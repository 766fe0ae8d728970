// Which column of a vehicle's recording is what? By name, header and unit, and else by kinematics.
#pragma once

#include <vector>

#include "identify/survey/signals.h"
#include "lib/data/csv.h"

namespace identikal {

/// Guesses steering angle, speed, yaw rate, lateral speed and acceleration, sideslip among the
/// columns of one recording. A name is cut into words ("LatAcc_obd": lat, acc, obd) and compared
/// with the usual ones in several spellings; an ending such as "_mps2" counts as unit. A unit that
/// nobody gives is chosen so that ay = vx r and vx delta = L r come out for a car's size. Columns
/// without telling names are tried where a quantity is missing: for r and ay the pair with the
/// highest correlation of vx r and ay, for the steering angle that of vx delta and r.
///
/// Every table keeps its own clock. Where time runs backwards a new run begins; runs are put one
/// after the other, parted by a gap.
/// Findings: several_runs, no_time, unit_unclear, guessed_by_physics.
///
/// Example:
///
///     const VehicleSignals found = guess_vehicle({read_csv("drive.csv")});
///     for (const VehicleSignal& signal : found.signals) std::puts(signal.column.c_str());
///
/// @param tables  the files of one recording
VehicleSignals guess_vehicle(const std::vector<Table>& tables);

}  // namespace identikal
