// What does the filter of a model file make of a recording, whatever the model's form?
#pragma once

#include <optional>

#include <Eigen/Core>

#include "identify/model/model.h"
#include "lib/base/random.h"
#include "lib/data/dataset.h"
#include "lib/filter/disturbance_smoother.h"
#include "lib/filter/kalman.h"
#include "lib/filter/simulation_smoother.h"
#include "lib/filter/smoother.h"

namespace identikal {

/// kalman_filter() of a linear model, one that changes included, nonlinear_filter() of another, from
/// the model's start.
///
/// Example:
///
///     const FilterResult filter = run_filter(model, model.parameters, recordings[0]);
///     const Eigen::VectorXd state_now = filter.x_filt.rightCols(1);
///
/// @param model  of the form linear or nonlinear
FilterResult run_filter(const Model& model, const ParameterSet& parameters,
                        const Dataset& recording, Keep keep = Keep::everything);

/// The model, in the state that its filter comes to through the rows before number `from`: mean and
/// covariance before that row is measured are its start. Nothing where from = 0, or where the filter
/// does not run or the rows before do not determine a diffuse start.
std::optional<Model> going_on(Model model, const ParameterSet& parameters, const Dataset& recording,
                              Eigen::Index from);

/// smooth() or nonlinear_smoother(), standard deviations without covariances.
/// @param lag  given what was recorded up to so many samples later: 0 filters. None: given all
SmootherResult run_smoother(const Model& model, const ParameterSet& parameters,
                            const Dataset& recording, std::optional<Eigen::Index> lag);

/// Can smooth_disturbances() serve it: is it linear, one that changes included, without S?
bool has_disturbance_smoother(const Model& model);

/// smooth_disturbances() of such a model.
DisturbanceResult run_disturbance_smoother(const Model& model, const ParameterSet& parameters,
                                           const Dataset& recording);

/// simulate_path() of a linear model, one that changes included.
SimulatedPath run_simulated_path(const Model& model, const ParameterSet& parameters,
                                 const Dataset& recording, Random& random);

}  // namespace identikal
