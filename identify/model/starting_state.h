// From which state does a recording begin, by the formulas of a model?
#pragma once

#include <Eigen/Core>

#include "identify/model/model.h"
#include "lib/data/dataset.h"
#include "lib/model/equilibrium.h"

namespace identikal {

/// Values of the parameters that the equations of a model have, the first of `at`, SI.
Eigen::VectorXd formula_parameters(const FormulaModel& model, const ParameterSet& at);

/// The start itself, or where the motion from it rests before the recording, as the model says
/// (FormulaModel::rests_at). Where it does not come to rest the state is NaN.
///
/// Example:
///
///     const Eigen::VectorXd p = Eigen::Vector2d(0.3, 1.2), x0 = Eigen::Vector2d::Zero();
///     const Equilibrium from = starting_state(as_formulas(model), p, x0, recordings[0]);
///     std::printf("x = %g, dx/dp = %g\n", from.x[0], from.wrt_p(0, 0));
///
/// @param p   of the model's equations, SI
/// @param x0  nx: as the file has it, SI
Equilibrium starting_state(const FormulaModel& model, const Eigen::Ref<const Eigen::VectorXd>& p,
                           const Eigen::Ref<const Eigen::VectorXd>& x0, const Dataset& recording);

/// The same at the values that the model, and the recording where it has its own, hold.
Equilibrium starting_state(const Model& model, const Dataset& recording);

}  // namespace identikal
