// Where does the integration of a model of formulas meet the inputs of a recording?
#pragma once

#include <vector>

#include "identify/model/model.h"
#include "lib/data/dataset.h"
#include "lib/model/nonlinear_model.h"

namespace identikal {

/// The recording's inputs, those that are late as they are with these delays, in as many steps from
/// sample to sample; at rest from its first row at infinity on.
///
/// Example:
///
///     const std::vector<int> two(static_cast<std::size_t>(recordings[0].size() - 1), 2);
///     const InputNodes nodes =
///         recording_nodes(as_formulas(model), model.parameters, recordings[0], two);
///
/// @param steps  N - 1
InputNodes recording_nodes(const FormulaModel& model, const ParameterSet& at,
                           const Dataset& recording, const std::vector<int>& steps);

/// The same for an integration that chooses its steps, see controlled_nodes().
///
/// Example:
///
///     const InputNodes nodes = controlled_recording_nodes(as_formulas(model), model.parameters,
///                                                         recordings[0], 1e-9);
InputNodes controlled_recording_nodes(const FormulaModel& model, const ParameterSet& at,
                                      const Dataset& recording, double tolerance);

}  // namespace identikal
