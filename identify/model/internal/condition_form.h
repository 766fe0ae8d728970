// In which rows do a model file's outputs count? `when` of outputs, and the `flags` that it asks.
#pragma once

#include "identify/model/model.h"
#include "identify/model/yaml_reader.h"

namespace identikal {

/// Conditions and flags of a model that has a filter; expects its inputs and outputs.
/// @throws InputError for a flag that is a channel already or that no condition asks, and for a
///   formula's mistake, at its line and column
void read_conditions(const YamlNode& root, Model& out);

}  // namespace identikal
