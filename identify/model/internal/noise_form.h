// Which noise and which start does a model file give? The same keys for matrices and for formulas.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "identify/model/matrix_reader.h"
#include "identify/model/model.h"
#include "identify/model/yaml_reader.h"
#include "lib/formula/dimension.h"
#include "lib/model/linear_model.h"

namespace identikal {

/// One state or output of a physical model.
struct PhysicalName {
  std::string name;
  Dimension dimension;
  /// Of an output that says its standard deviation itself; a bare number is in this unit.
  const YamlNode* sd = nullptr;
  std::string unit = {};
};

/// What a physical model calls its states and outputs, so that noise and start may be given by name
/// and their units checked. Without states: the model is given by matrices.
struct PhysicalNames {
  std::vector<PhysicalName> states, outputs;
  std::vector<Dimension> inputs;  ///< of the inputs, which formulas of the noise may hold
  bool with_units = false;        ///< else no dimension is checked
};

/// G, Q, R, S and what the process noise is. A physical model may also say
///
///   noise: {process: {kind: density, sd: {vy: 0.1}}, measurement: {sd: {r: 0.01 rad/s}}}
///
/// with sd or variance: a number, a quantity, or a formula of parameters, inputs and time; states that it does not
/// name have no noise of their own. Expects A and C of `model`, with their sizes.
void read_noise(const YamlNode& root, const PhysicalNames& physical, NamedParameters& parameters,
                LinearModel& model);

/// {kind: student, freedom: 4} of the measurement noise; freedom may be a parameter's name. Nothing
/// where the noise is normal. Marks the parameter as used.
std::optional<StudentNoise> read_student(const YamlNode& root, NamedParameters& parameters);

/// stationary, diffuse, or {mean, sd} and {mean, covariance}: lists, or by the states' names.
/// Expects A of `model`, with its size.
void read_initial(const YamlNode& root, const PhysicalNames& physical, NamedParameters& parameters,
                  LinearModel& model);

/// A start that is stationary belongs to matrices that stay what they are.
/// @throws InputError at `initial` where A, G or Q hold inputs or time
void refuse_stationary_start_of_changes(const YamlNode& root, const LinearModel& model);

}  // namespace identikal
