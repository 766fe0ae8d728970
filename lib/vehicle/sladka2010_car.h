// Which car do examples, studies and tests drive?
#pragma once

#include "lib/vehicle/single_track.h"

namespace identikal {

/// The passenger car of Sladká (2010), table 8.1, SI; neutral where the table is silent.
///
/// Example:
///
///     const SingleTrack<> passenger_car = linear_car(sladka2010_car());
inline VehicleParameters<double> sladka2010_car() {
  VehicleParameters<double> p = neutral_vehicle();
  p[kMass] = 1446.0;
  p[kA] = 0.987;
  p[kB] = 1.525;
  p[kYawInertia] = 2319.0;
  p[kCf] = p[kCr] = 88107.7;
  p[kSteeringRatio] = 21.0;
  return p;
}

}  // namespace identikal
