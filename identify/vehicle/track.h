// How do cornering stiffness and yaw inertia change along a recording?
#pragma once

#include "identify/estimate/results.h"
#include "identify/model/model_file.h"
#include "lib/data/dataset.h"

namespace identikal {

/// Recursive least squares on the balances of force and moment (identify/vehicle/starts.h) in
/// continuous time, no discrete coefficients in between: at every mean of 0.1 s the two rows
///   m ay = Cf slip_front + Cr slip_rear,   0 = a Cf slip_front - b Cr slip_rear - Iz r',
/// linear in those of Cf, Cr and Iz that are free. (One after the other, Iz from forces that are
/// estimated, costs a factor 2.5 to 4 in their errors.) The second is weighted so that both leave
/// residuals of one median size over the recording. Coefficients are relative to the file's values,
/// P(0) = I / delta, delta = 0.01 (m/s^2)^2. Forgetting as Model::regression has it, per mean;
/// without it by choose_forgetting(), with a memory of 5 s or more.
///
/// Noise of the sensors is noise of the regressors here, which biases the values: it follows a
/// change, the values are fit_vehicle()'s to find.
///
/// Example:
///
///     const auto course = track_vehicle(car, recordings[0]);
///
/// @throws InputError when no row is usable, the outputs do not show the balances, none of the
/// three
///   is free, or the rows are too few
TrackedCoefficients track_vehicle(const Model& model, const Dataset& recording);

}  // namespace identikal
