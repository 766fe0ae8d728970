// A model as formulas, from text.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "lib/model/nonlinear_model.h"

namespace identikal {

struct Written {
  std::vector<std::string> states, inputs, parameters;
  std::vector<std::string> dynamics, outputs;
  std::vector<std::pair<std::string, std::string>> definitions;
  bool continuous = true;
};

inline ModelFormulas formulas_of(const Written& w) {
  ModelFormulas out;
  out.states = static_cast<int>(w.states.size());
  out.inputs = static_cast<int>(w.inputs.size());
  out.parameters = static_cast<int>(w.parameters.size());
  out.continuous = w.continuous;
  std::vector<std::string> names = w.states;
  names.insert(names.end(), w.inputs.begin(), w.inputs.end());
  names.insert(names.end(), w.parameters.begin(), w.parameters.end());
  names.emplace_back("t");
  for (const auto& [name, text] : w.definitions) {
    out.definitions.push_back(parse_expression(text, names));
    names.push_back(name);
  }
  for (const std::string& f : w.dynamics) out.dynamics.push_back(parse_expression(f, names));
  for (const std::string& h : w.outputs) out.outputs.push_back(parse_expression(h, names));
  return out;
}

inline Written single_track_formulas() {
  return {{"vy", "r"},
          {"steer", "vx"},
          {"m", "a", "b", "Iz", "Cf", "Cr"},
          {"(Ff + Fr)/m - vx*r", "(a*Ff - b*Fr)/Iz"},
          {"r", "(Ff + Fr)/m"},
          {{"Ff", "Cf*(steer/21 - (vy + a*r)/vx)"}, {"Fr", "-Cr*(vy - b*r)/vx"}},
          true};
}

}  // namespace identikal
