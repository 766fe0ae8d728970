// Do the signals of a vehicle's recording agree with each other as a car's motion has to: ay =
// dvy/dt + vx r, beta = vy/vx, r follows vx delta / L? Else units, signs, clocks or columns are
// wrong.
#pragma once

#include "identify/survey/internal/aligned_signals.h"

namespace identikal::surveying {

/// Needs speed and yaw rate. Finds swapped_channels, units_ay, units_steering, no_steering,
/// clock_offset, clock_unclear, sign_steering, sign_r, sign_ay, sign_vy; turns signs in the
/// mapping.
void check_kinematics(Scene& scene);

}  // namespace identikal::surveying
