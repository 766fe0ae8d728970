// What has to hold between a model file's parameters? `constraints`.
#pragma once

#include "identify/model/model.h"
#include "identify/model/yaml_reader.h"

namespace identikal {

/// A list of "LEFT < RIGHT", with <=, >, >= or = in its place; either side is a formula of parameters
/// or a quantity, "2.6 m". Expects the model's parameters; their units are checked where all of a
/// model's are known: of vehicles and of formulas with units.
/// @throws InputError at the place of a mistake: another form, a name that is no parameter, a matrix,
///   fewer than two that are free, sides of different dimensions, more than 100
void read_constraints(const YamlNode& root, bool with_units, Model& out);

}  // namespace identikal
