// Is a yaw inertia that of a drawing?
#pragma once

#include "identify/estimate/estimate.h"

namespace identikal {

/// Whether this is a yaw inertia whose error comes for the most part by what the model leaves out: lags
/// of sensors and steering, roll and tyres that bend act on the yaw motion as an inertia does, and where
/// the recording does not tell them apart the estimate holds them. It simulates the car, and is not the
/// inertia of its masses. Never with `fit --structure auto`, whose value allows for them.
///
/// Example:
///
///     for (const EstimatedParameter& p : estimate.parameters) {
///       if (is_effective_inertia(p)) std::puts("Iz is effective");
///     }
bool is_effective_inertia(const EstimatedParameter& parameter);

}  // namespace identikal
