// What does a model file with `model: single-track` say?
#pragma once

#include <vector>

#include "identify/model/model.h"
#include "identify/model/model_values.h"
#include "identify/model/yaml_reader.h"
#include "lib/vehicle/axle.h"

namespace identikal {

/// The parameters of a car with tyres of this curve, and of its sensors.
std::vector<ParameterRule> vehicle_rules(TyreCurve curve);

/// Fills inputs, outputs, parameters and the vehicle.
/// @throws InputError at line and column
void read_vehicle(const YamlNode& root, Model& out);

}  // namespace identikal
