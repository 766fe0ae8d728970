// The regression form of a model file: inputs, one output, how many samples of each, how fast the
// past is forgotten.
#pragma once

#include "identify/model/model.h"
#include "identify/model/yaml_reader.h"

namespace identikal {

/// Fills inputs, outputs and settings; the model's time is read already.
void read_regression(const YamlNode& root, ModelFile& out);

/// The key `regression`; of a vehicle it holds forgetting, memory and reset alone.
RegressionSettings read_regression_settings(const YamlNode& root, ModelFile::Form form);

}  // namespace identikal
