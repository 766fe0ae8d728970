// Are verdicts on vehicles right? Counted over drives of cars that are known.
#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "identify/vehicle/fit.h"
#include "tests/campaigns/vehicle_drive.h"

namespace identikal {

/// A parameter is wrong that lies more than 2.6 of its standard errors and more than 5 % off.
struct VehicleVerdicts {
  int ok_right = 0, ok_wrong = 0, refused_right = 0, refused_wrong = 0;
  /// Of the refused and right, those that only an error of more than a quarter makes right: by more
  /// than 5 % off.
  int refused_wide = 0;
  /// Of the refused, those that nobody could know to a quarter: least_errors() of somebody who knows
  /// how cars are drawn.
  int unknowable = 0;
  int intervals = 0, covered = 0;  ///< 95 % intervals of results with status ok
  /// Refused, and ok once the changes that the findings name were made.
  int cured_right = 0, cured_wrong = 0;
  /// Of the ok, and of the refused, and wrong, those whose faults nobody could tell: least_misfit()
  /// below 9.
  int ok_wrong_unknowable = 0, refused_wrong_unknowable = 0;
  std::map<DriveFault, int> wrong_by_fault;       ///< of the ok and wrong, one for each fault
  std::map<DriveFault, int> unknowable_by_fault;  ///< of those that nobody could tell

  int drives() const { return ok_right + ok_wrong + refused_right + refused_wrong; }
};

/// Fits draw_vehicle_drive(seed + i, faults), i = 0 .. count - 1.
/// @param structure  --structure
/// @param each  a line for every drive, on standard output
VehicleVerdicts judge_vehicle_drives(
    std::uint64_t seed, int count, int faults,
    VehicleFitOptions::Structure structure = VehicleFitOptions::Structure::as_written,
    bool each = false);

/// One line, with the shares that matter.
std::string in_words(const std::string& name, const VehicleVerdicts& verdicts);

}  // namespace identikal
