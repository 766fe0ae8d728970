// The linear form of a model file: matrices whose entries are numbers or formulas of parameters.
#pragma once

#include "identify/model/model.h"
#include "identify/model/yaml_reader.h"

namespace identikal {

/// Fills parameters, inputs, outputs and the linear model; the model's time is read already.
void read_linear(const YamlNode& root, Model& out);

}  // namespace identikal
