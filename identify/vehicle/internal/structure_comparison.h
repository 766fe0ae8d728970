// Would another form of the model say something else?
#pragma once

#include "identify/vehicle/covariance.h"
#include "identify/vehicle/search.h"

namespace identikal {

/// Fits the car again with the sign of vy, then of beta, turned, where they fit badly. Kinematics
/// tell a wrong sign only where ay is measured too; here a residual that another sign makes smaller
/// by two fifths is one: wrong_sign, serious.
void check_sensor_misalignment(const VehicleSearch& found, const VehicleSearchOptions& options,
                               Estimate& estimate);

/// Fits the car again with one thing changed at a time (the gain of the steering free, its delay
/// free, another tyre curve) and says how parameters and fit move with it. A steering that fits
/// clearly better with another gain or delay makes a warning: the recording then speaks against the
/// model file's ratio, or against the clock of the steering channel. What ends at a bound is left
/// out.
void compare_alternatives(const VehicleSearch& found, const VehicleSearchOptions& options,
                          Estimate& estimate);

}  // namespace identikal
