// Where was a car driven? A fit knows nothing of what lies beyond.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "identify/estimate/recording_fit.h"
#include "identify/vehicle/output_error.h"

namespace identikal {

/// Of the rows of a simulation:
///
///   vx                 as measured [m/s]
///   ay                 vx r, of the simulated yaw rate [m/s^2]
///   beta               atan(vy / vx), of the simulated motion [deg]
///   steering frequency below which 95 % of the steering's power lies [Hz], of the longest segment;
///                      left out where that is shorter than 64 rows
std::vector<DrivenRange> driven_ranges(const VehicleProblem& problem, const Eigen::VectorXd& z);

/// In words, in what `here` goes beyond `fitted` by more than a tenth of a speed, a sixth of an
/// acceleration or a third of a sideslip, and 0.3 m/s^2 or 1 deg; empty where it does not, or where
/// `fitted` is. A frequency says how far the inertia was seen, and is no limit.
///
/// Example:
///
///     const std::vector<DrivenRange> fitted = {{"vx", "m/s", 14.0, 17.0}};
///     std::puts(beyond(fitted, {{"vx", "m/s", 25.0, 28.0}}).c_str());  // vx 25 to 28 m/s (...)
std::string beyond(const std::vector<DrivenRange>& fitted, const std::vector<DrivenRange>& here);

}  // namespace identikal
