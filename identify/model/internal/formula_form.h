// The physical form of a model file: states that move by formulas.
#pragma once

#include "identify/model/model.h"
#include "identify/model/model_file.h"
#include "identify/model/yaml_reader.h"

namespace identikal {

/// Fills states, parameters, inputs, outputs, noise and start from
///
///   states: {phi: rad, w: rad/s}
///   let: {torque: ...}
///   dynamics: {phi: w, w: -g/l*sin(phi)}
///   outputs: {angle: {column: a, unit: deg, equals: phi}}
///
/// and decides the form: linear when the formulas are so whatever the parameters are, and neither
/// irregular sampling nor smooth inputs ask for more, nor `reading` for the formulas as they are
/// written; else nonlinear. Units are checked before
/// anything runs, unless the states are a list without any.
void read_formulas(const YamlNode& root, FormulaReading reading, Model& out);

}  // namespace identikal
