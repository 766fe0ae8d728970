// How is a regression of columns on columns, `model: static`, written as formulas?
#pragma once

#include "identify/model/yaml_reader.h"

namespace identikal {

/// The file as a model of formulas: with a state that stands still, which formulas need, and rows a
/// second apart where it says nothing of time. A file that is not static is returned as it is.
/// @throws InputError for keys of models that move
YamlNode with_still_state(YamlNode root);

}  // namespace identikal
