// How does a model get the values that a result holds?
#pragma once

#include <string>

#include "identify/estimate/estimate.h"
#include "identify/model/model_file.h"

namespace identikal {

/// Puts every value of the result, known ones too, into the model; what is free stays free.
///
/// Example:
///
///     set_values(model, estimate, "out/result.json");  // the path is for messages
///
/// @param path  of the result, for messages
/// @throws InputError when the result lacks a free parameter or an entry of a matrix, has one that
///   the model has not, a unit of another kind, no value, or values that make no model
void set_values(Model& model, const Estimate& result, const std::string& path);

/// The model that a result of `fit --objective simulation` was made with, as set_values() takes it: earlier programs
/// gave every output a var_OUTPUT in SI where the file names a standard deviation, too.
/// @param model  of formulas, read as they are written
/// @throws InputError as without_process_noise() (identify/model/simulation_model.h)
Model simulated_in(const Estimate& result, Model model);

}  // namespace identikal
