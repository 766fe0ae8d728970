// How well could anybody know the car from a drive?
#pragma once

#include <array>

#include "tests/campaigns/vehicle_drive.h"

namespace identikal {

/// What somebody knows of what the car has beside a single track.
enum class Insight {
  everything,   ///< relaxation, lag, roll and bending of this car's
  the_drawing,  ///< how draw_vehicle_drive() draws them
};

/// Cramer-Rao bound of the standard errors of Cf, Cr, Iz over their values: of a drive without
/// faults, offsets and biases unknown, the sensors' noise white. It asks nothing of the fit that is
/// judged.
std::array<double, 3> least_errors(const VehicleDrive& drive, Insight insight);

}  // namespace identikal
