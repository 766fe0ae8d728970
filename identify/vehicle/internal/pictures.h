// What did the car's axles, track and likelihood look like?
#pragma once

#include "identify/estimate/results.h"
#include "identify/vehicle/covariance.h"
#include "identify/vehicle/search.h"

namespace identikal {

/// The car as the search found it, what it was fitted to, and the errors that go with it; the
/// estimate already holds their values and its series. Fills all pictures but those of searches and
/// held-out data.
///
/// Axles: the forces that balances of force and moment ask for (identify/vehicle/starts.h), alongside
/// the fitted curve over the slips that the car went through. Tracks (lib/vehicle/trajectory.h) of
/// the longest segment: simulated, and from measured yaw rate and sideslip where there are both.
void picture_vehicle(const VehicleSearch& found, const VehicleCovariance& covariance,
                     VehicleEstimate& estimate);

}  // namespace identikal
