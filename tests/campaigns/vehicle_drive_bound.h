// How well could anybody know the car from a drive?
#pragma once

#include <array>
#include <string_view>

#include "tests/campaigns/vehicle_drive.h"

namespace identikal {

/// What somebody knows of what the car has beside a single track.
enum class Insight {
  everything,   ///< relaxation, lag, roll and bending of this car's
  the_drawing,  ///< how draw_vehicle_drive() draws them
};

/// Cramer-Rao bound of the standard errors of Cf, Cr, Iz over their values: of a drive without
/// faults, offset of the steering and biases of r and ay unknown, the sensors' noise white. It asks
/// nothing of the fit that is judged.
std::array<double, 3> least_errors(const VehicleDrive& drive, Insight insight);

/// Chi-square that is left between what the sensors showed, without noise, and what a car with these
/// numbers shows, at its least over Cf, Cr, Iz, the offset of the steering, biases of r and ay, and
/// effects as the_drawing has them. Below 9 nobody tells the numbers from the right ones at three
/// standard deviations.
/// @param written  the car with the mass, axles and ratio of the model file
/// @param speed    as recorded [m/s]
double least_misfit(const VehicleDrive& drive, const SingleTrack<>& written, double speed);

/// The same with the numbers of the drive's faults: ratio, swapped axles, lever arm, speed scale,
/// gain, turned sensor. Infinite where it has others: these count as knowable.
double least_misfit(const VehicleDrive& drive);

/// The measurement that reveals such a number; empty for other faults.
std::string_view revealed_by(DriveFault fault);

}  // namespace identikal
