// What does a model file take from other files?
#pragma once

#include <string>

#include "identify/yaml_reader.h"

namespace identikal {

/// read_yaml() of a file and of those that its key `include` names, one or a list, relative to it:
/// keys that the file does not have itself are theirs, the first named first. `parameters` and
/// `let` are put together entry by entry. Every value keeps the place where it stands.
/// @throws InputError also for a file that cannot be opened, includes itself, or is nested deeper
///   than eight files
YamlNode read_with_included(const std::string& path);

}  // namespace identikal
