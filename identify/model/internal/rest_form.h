// Where does the motion of a model file come to rest, before a recording or at its end?
#pragma once

#include <string>
#include <vector>

#include "identify/model/model.h"
#include "identify/model/yaml_reader.h"

namespace identikal {

/// What `initial: steady-state` stands on: the word itself, or `kind` of a mapping that has it.
/// nullptr: the start is another.
const YamlNode* steady_state_start(const YamlNode& root);

/// `inputs` of such a start: what inputs were before the recording, SI; none where it does not say.
/// @throws InputError for an input that the model does not have
std::vector<std::optional<double>> inputs_at_rest(const YamlNode& root,
                                                  const std::vector<ChannelSource>& inputs);

/// The file with the start that the motion comes to rest from, zero where none is said.
YamlNode with_start_at_rest(YamlNode root, const std::vector<StateName>& states);

/// Does `time` say that rows at infinity are measured in a steady state?
bool has_infinity(const YamlNode& root);

/// @throws InputError at what moves states besides their equations, which `what` does not allow:
///   process noise, a start with a variance
void refuse_moving_noise(const YamlNode& root, const std::string& what);

}  // namespace identikal
