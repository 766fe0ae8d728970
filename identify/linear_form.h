// The linear form of a model file: matrices whose entries are numbers or multiples of parameters.
#pragma once

#include <optional>
#include <string>

#include "identify/model_file.h"
#include "identify/yaml_reader.h"

namespace identikal {

/// Fills parameters, inputs, outputs and the linear model; the model's time is read already.
void read_linear(const YamlNode& root, ModelFile& out);

/// Is the value of a matrix-valued parameter one that its coordinates can reach and leave again?
/// Says what is wrong, or nothing.
std::string domain_fault(const Parameter& parameter);

/// What is wrong with a model, and the key of the file that says so.
struct ModelFault {
  std::string key, text;
};

/// The first matrix that overflows, or covariance that is not positive semidefinite, at these
/// values.
std::optional<ModelFault> fault_at(const LinearModel& model, const ParameterSet& parameters);

}  // namespace identikal
