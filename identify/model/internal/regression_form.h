// The regression form of a model file: inputs, one output, how many samples of each, how fast the
// past is forgotten.
#pragma once

#include "identify/model/model.h"
#include "identify/model/yaml_reader.h"

namespace identikal {

/// Fills inputs, outputs and the regression; the model's time is read already.
void read_regression(const YamlNode& root, Model& out);

/// The key `regression` of a vehicle, which holds forgetting, memory and reset alone.
RegressionModel read_tracking(const YamlNode& root);

}  // namespace identikal
