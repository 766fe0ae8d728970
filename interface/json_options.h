// How does a program set the options of a verb? A JSON object with their long names.
#pragma once

#include <string>

#include "jobs/verb.h"

namespace identikal {

/// Takes every value of the object: {"starts": 1, "robust": true, "set": ["q=1"]}. Arguments, and
/// what only a terminal has (json, quiet), are not among the names.
/// @throws InputError for text that is no such object, an unknown name (the nearest is offered), or
///   a value that the option does not take
void take_json_options(const Verb& verb, const std::string& text);

}  // namespace identikal
