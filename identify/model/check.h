// Do a model and recordings fit together, wherever they come from? Every job that estimates, tests or filters asks this
// first.
#pragma once

#include <string>
#include <vector>

#include "identify/model/model.h"
#include "lib/data/dataset.h"

namespace identikal {

/// @throws std::invalid_argument, with both sizes, for a parameter without a finite value or that
///   is free and that nothing uses, a matrix of another size than A and C ask for, an entry outside
///   of its matrix, NaN, Q or R that is not symmetric or not positive semidefinite, [Q S; S' R]
///   that is indefinite
void check_model(const Model& model);

/// @throws std::invalid_argument, with both sizes, for a number of channels other than the model's,
///   no sample, a time axis of another length than the samples, that is missing, not finite or does
///   not rise, a sampling period that is not above 0 or other than the model's, samples that are
///   infinite
void check_recording(const Model& model, const Dataset& recording);

/// The same of times and inputs; outputs are not looked at.
void check_inputs(const Model& model, const Dataset& recording);

/// A model and a recording of its outputs, and the model as a job uses it: a linear model that gives no sampling period has the
/// recordings', matrices that were left empty are zero (B, D, S) or the identity (G).
///
/// Example:
///
///     try {
///       const Model complete = checked(model, recordings);
///     } catch (const std::invalid_argument& mistake) {
///       std::puts(mistake.what());  // C is 1 x 3; expected 1 x 2 (outputs x states)
///     }
///
/// @throws std::invalid_argument as both, and without a recording
Model checked(Model model, const std::vector<Dataset>& recordings);

/// The same for a job that needs no outputs: the model, and times and inputs where there are any.
/// @param inputs  may be null
Model checked_with_inputs(Model model, const Dataset* inputs);

/// @param what  has no place for constraints between parameters and for smooth curves: "als"
/// @throws InputError where the model has any
void refuse_constraints(const Model& model, const std::string& what);

}  // namespace identikal
