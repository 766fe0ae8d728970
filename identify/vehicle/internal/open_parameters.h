// Which parameters did the recording leave open?
#pragma once

#include "identify/estimate/results.h"
#include "identify/vehicle/covariance.h"
#include "identify/vehicle/search.h"

namespace identikal {

/// What stands against any fit: parameters that are open (not_identifiable), a search that did not
/// converge.
/// @param estimate  with its verdicts
Findings check_search(const VehicleSearch& found, const VehicleCovariance& covariance,
                      const VehicleEstimate& estimate);

}  // namespace identikal
