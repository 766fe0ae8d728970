// What does the filter of a model file make of a recording, whatever the model's form?
#pragma once

#include "identify/model_file.h"
#include "lib/dataset.h"
#include "lib/kalman.h"

namespace identikal {

/// kalman_filter() of a linear model, nonlinear_filter() of another, from the model's start.
/// @param model  of the form linear or nonlinear
FilterResult run_filter(const ModelFile& model, const ParameterSet& parameters,
                        const Dataset& recording, Keep keep = Keep::everything);

}  // namespace identikal
