// Which inputs of a model file are late by an unknown time? `delay: NAME`.
#pragma once

#include <optional>

#include "identify/model/matrix_reader.h"
#include "identify/model/yaml_reader.h"
#include "lib/model/nonlinear_model.h"

namespace identikal {

/// Takes `delay` out of an input where it names a parameter, which then is used.
/// @return its position; none where the delay is a time, or there is none
/// @throws InputError for a name that is no parameter, one that is no time, and one that is free
///   without min and max
std::optional<int> take_unknown_delay(YamlNode& input, NamedParameters& parameters);

/// @throws InputError at what serves inputs alone whose delay is known: references, doses, starts in
///   a steady state, inputs: pchip
void refuse_beside_late_inputs(const YamlNode& root, InputPath path, bool starts_at_rest);

}  // namespace identikal
