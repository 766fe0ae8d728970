// What did inputs do that a model takes as late by an unknown time?
#pragma once

#include <vector>

#include <Eigen/Core>

#include "identify/model/model.h"
#include "lib/data/dataset.h"

namespace identikal {

/// The inputs of a model's equations with these delays: the recording's, and where an input U is
/// late by tau,
///
///   U(t - tau) + U'(t - tau) tau   in its place and   U'(t - tau)   in the further row
///
/// (ModelFormulas::LateInput), U being a smooth curve through the samples that were recorded (cubic
/// convolution) that stays what it was before the first and behind the last.
///
/// Example:
///
///     const FormulaModel& formulas = as_formulas(model);
///     const Eigen::MatrixXd u = inputs_at(formulas, model.parameters, recordings[0]);
///
/// @param at  the parameters, whose delays count
Eigen::MatrixXd inputs_at(const FormulaModel& model, const ParameterSet& at,
                          const Dataset& recording);

/// Parts of a recording in which late inputs are known whatever their delays are, from `min` to `max`
/// of the parameters, each with what was recorded of these inputs. Where none is late, the recording.
/// In `u` stands what the inputs were with the model's own delays.
std::vector<Dataset> with_late_records(const Model& model, Dataset recording);

}  // namespace identikal
