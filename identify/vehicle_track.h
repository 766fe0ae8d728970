// How do cornering stiffness and yaw inertia change along a recording?
#pragma once

#include "identify/estimate.h"
#include "identify/model_file.h"
#include "lib/dataset.h"

namespace identikal {

/// Recursive least squares on the balances of force and moment (identify/vehicle_starts.h), those
/// of Cf, Cr and Iz that are free, in continuous time: no discrete coefficients in between. Cf and
/// Cr from m ay = Ff + Fr; then 1 / Iz from r' = (a Ff - b Fr) / Iz with the stiffnesses of the
/// same moment. Coefficients are relative to the file's start, P(0) = I / delta with delta = 0.01
/// (m/s^2)^2 and (rad/s^2)^2. Forgetting as ModelFile::regression has it; without it by
/// choose_forgetting().
///
/// Noise of the sensors is noise of the regressors here, which biases the values: it follows a
/// change, the values are fit_vehicle()'s to find.
/// @throws InputError when no row is usable, the outputs do not show the balances, none of the
/// three
///   is free, or the rows are too few
Estimate track_vehicle(const ModelFile& model, const Dataset& recording);

}  // namespace identikal
