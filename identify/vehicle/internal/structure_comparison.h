// Would another structure of the model change the estimates?
#pragma once

#include "identify/estimate/results.h"
#include "identify/vehicle/covariance.h"
#include "identify/vehicle/search.h"

namespace identikal {

/// Fits the car again with the sign of vy, then of beta, reversed, where they fit badly. Kinematics
/// show a wrong sign only where ay is measured too; here a residual that the other sign makes
/// smaller by two fifths is one: wrong_sign, serious.
Findings check_sensor_misalignment(const VehicleSearch& found, const VehicleSearchOptions& options,
                                   const VehicleEstimate& estimate);

struct AlternativeForms {
  Findings findings;
  std::vector<std::string> notes;  ///< of those that change little
};

/// Fits the car again with one thing changed at a time (the gain of the steering free, its delay
/// free, another tyre curve) and notes how parameters and fit change with it. A steering that fits
/// clearly better with another gain or delay makes a warning: the recording then contradicts the
/// model file's ratio, or the clock of the steering channel. What ends at a bound is left out.
AlternativeForms compare_alternatives(const VehicleSearch& found,
                                      const VehicleSearchOptions& options,
                                      const VehicleEstimate& estimate);

}  // namespace identikal
