// What do sensors do to what they measure: a bias, a scale, a delay, an error that lasts?
#pragma once

#include "identify/model/yaml_reader.h"

namespace identikal {

/// A model of formulas with its `sensors` written out, as extended() writes them:
///
///     y(t) = scale h(x(t - delay)) + bias + e(t),   e' = -e/tau + w,   sd(e) = sd
///
/// of an output; of an input u what acts is (u - bias - e)/scale, and no delay. Each is a number,
/// `free`, or what a parameter may be (`{value: 0.1 m, min: 0}`); `error` is `markov`, with both of
/// its numbers free, or a mapping of `sd` and `tau`. What `parameters` says of one of them, by its
/// name (bias_z, sd_z), goes first. Any other model is returned as it is.
///
/// Example:
///
///     const YamlNode root = with_sensors(read_yaml("tracker.yaml"));
///     std::printf("%zu parameters\n", find(root, "parameters")->keys.size());
///
/// @throws InputError for what is neither an input nor an output, an unknown key, a state that
///   is there already, a delay that cannot be (extended())
YamlNode with_sensors(YamlNode root);

}  // namespace identikal
