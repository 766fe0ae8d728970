// How does a state move whose rates are linear in it and in the inputs? Internal to lib/model.
#pragma once

#include "lib/model/nonlinear_model.h"

namespace identikal {

/// step() by the map of AffineStep, once an interval of this length is met a second time.
/// @param jacobian  null: none; else with first derivatives
/// @return false: nothing is done, the steps have to be made one by one
bool repeat_affine_motion(const NonlinearModel& model, ModelMemory& m, const InputNodes& inputs,
                          Eigen::Index k, Eigen::Ref<Eigen::VectorXd> x, Jacobian* jacobian);

/// Through the fixed Runge-Kutta steps of an interval, one by one.
void follow_fixed_steps(const NonlinearModel& model, ModelMemory& m, const InputNodes& inputs,
                        Eigen::Index k, Eigen::Ref<Eigen::VectorXd> x, Jacobian* jacobian);

}  // namespace identikal
