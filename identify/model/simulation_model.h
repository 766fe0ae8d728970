// Which model has a simulation that recordings are compared with? One without process noise, from a
// start that is unknown.
#pragma once

#include <vector>

#include "identify/model/model.h"
#include "lib/data/dataset.h"

namespace identikal {

/// How the variance of an output's errors is called: var_OUTPUT.
inline constexpr const char* kVarianceName = "var_";
/// How an unknown start is called: STATE_start, of the second recording STATE_start_2.
inline constexpr const char* kStartName = "_start";

/// The model without process noise, from the start that the file gives: what moves the state are that
/// and the inputs alone. The errors of each output have a variance of their own, as the file names it,
/// as a variance or a standard deviation, or var_OUTPUT. Parameters that have no part in it any more are fixed at zero.
/// @param model  of formulas, read as they are written (FormulaReading::as_written)
/// @param all_in_si  every output has a var_OUTPUT, in SI, whatever the file names: as results of earlier
///                   programs have it
/// @throws InputError for another model
Model without_process_noise(Model model, bool all_in_si = false);

/// The same where the start of every recording is unknown in the states that the file gives a standard
/// deviation there.
///
/// Example:
///
///     const Model simulated = simulation_model(model, recordings);
///     for (const Parameter& p : simulated.parameters) if (!p.fixed) std::puts(p.name.c_str());
///
/// @throws InputError as above, and for a parameter with a prior
Model simulation_model(Model model, const std::vector<Dataset>& recordings);

/// The recordings with the starts that were found, for what looks at one of them by itself.
std::vector<Dataset> with_starts(const Model& model, const ParameterSet& at,
                                 std::vector<Dataset> recordings);

}  // namespace identikal
