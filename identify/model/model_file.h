// What did the user write in the model file? Reads YAML into values; says where and what when it
// cannot.
#pragma once

#include <string>

#include "identify/model/model.h"
#include "identify/model/yaml_reader.h"

namespace identikal {

/// What becomes of formulas that are linear in the states.
enum class FormulaReading {
  linear,      ///< a linear model, with Kalman's own filter
  as_written,  ///< formulas like any others; a start that is not given is N(0, 1) for every state
};

/// @throws InputError at line and column for text that is not YAML, unknown, duplicate or missing
/// keys, a value of the
///   wrong kind, wrong matrix sizes, unknown parameter names (the nearest is offered), unknown
///   units, NaN or infinite numbers, negative variances, a start outside its bounds.
///
/// Example:
///
///     Model level = read_model_file("examples/nile.yaml");
///     set_parameter(level, "q=1469");
Model read_model_file(const std::string& path);

/// The same from the file's text. @param path  for messages, and a name where the text has none
Model parse_model_file(const std::string& text, const std::string& path,
                       FormulaReading reading = FormulaReading::linear);

/// What a tree of keys and values means, as parse_model_file() has read one.
Model model_of(const YamlNode& root, const std::string& path = "",
               FormulaReading reading = FormulaReading::linear);

/// Applies "NAME=VALUE" from the command line to the value (the start, when the parameter is free).
/// VALUE is in the model file's unit for that parameter or carries a unit of its own ("80 kN/rad").
/// @throws InputError for an unknown name, an unreadable value, or a value outside the bounds.
void set_parameter(Model& model, const std::string& assignment);

}  // namespace identikal
