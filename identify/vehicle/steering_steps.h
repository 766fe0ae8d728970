// What do the steps of the steering's sensor do to the values?
#pragma once

#include <Eigen/Core>

#include "identify/estimate/results.h"
#include "identify/vehicle/search.h"

namespace identikal {

/// The step that all values are multiples of, within 5 %, from a common one; 0 where there is none.
/// @param x  samples; NaN are missing
double step_of(const Eigen::VectorXd& x);

/// The angle between the steps: where the reading changes from one level to the next the angle passes
/// midway between them; from there to the next change it goes smoothly (cubics), within half a step of
/// what was read.
///
/// Example:
///
///     Eigen::VectorXd angle = recordings[0].u.row(0);
///     const double step = step_of(angle);
///     if (step > 0.0) angle = bridged_steps(recordings[0].time, angle, step);
///
/// @param time  N increasing time stamps [s]
/// @param x     N readings without gaps
Eigen::VectorXd bridged_steps(const Eigen::VectorXd& time, const Eigen::VectorXd& x, double step);

/// Errors of an input act otherwise than noise of the outputs: they attenuate, Cf, Cr and Iz come out
/// too small or too large, whatever the number of samples, and no standard error shows it. Fits once
/// more with the angle bridged between its steps: steering_steps, with the size of the change, serious
/// where that is above 5 % and the standard error. Nothing where the steps are below 0.3 % of the
/// angle's motion or bridged already.
Findings check_steering_steps(const Model& model, const VehicleSearch& found,
                              const VehicleEstimate& estimate);

}  // namespace identikal
