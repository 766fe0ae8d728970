// Which states, dynamics and noise does one component have: a trend, a season, a clock?
#pragma once

#include <string>
#include <vector>

#include "identify/model/yaml_reader.h"

namespace identikal {

/// What one component adds to the model.
struct Component {
  struct State {
    std::string name, unit, dynamics;
  };
  struct Noise {
    std::string state;
    YamlNode variance;
  };
  struct Known {
    std::string name;
    YamlNode value;
  };
  std::vector<State> states;
  std::vector<Known> known;  // parameters that its formulas hold
  std::vector<Noise> noise;
  std::string visible;  // what the outputs see of it
  // Those that start in their steady state; the others diffuse.
  std::vector<std::string> stationary_states;
};

/// @param node        its value under `components`
/// @param continuous  time of the model
/// @throws InputError for an unknown kind or key, or one of the other kind of time
Component component_of(const std::string& name, const YamlNode& node, bool continuous);

}  // namespace identikal
