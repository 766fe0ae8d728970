// What does a model file take from other files?
#pragma once

#include <string>
#include <vector>

#include "identify/model/yaml_reader.h"

namespace identikal {

/// parse_yaml() of a file's text, and read_yaml() of the files that its key `include` names, one or
/// a list, relative to it: keys that the file does not have itself are theirs, the first named
/// first. `parameters` and `let` are put together entry by entry. Every value keeps the place where
/// it stands.
///
/// Example:
///
///     const std::string text = read_yaml_text("car.yaml");
///     const YamlNode root = parse_with_included(text, "car.yaml");
///     for (const auto& path : included_files(text, "car.yaml")) std::puts(path.c_str());
///
/// @param path  of the file, which need not be there any more
/// @throws InputError also for an included file that cannot be opened, includes itself, or is
/// nested deeper
///   than eight files
YamlNode parse_with_included(const std::string& text, const std::string& path);

/// Paths of the files that it includes, and of those that they include.
std::vector<std::string> included_files(const std::string& text, const std::string& path);

}  // namespace identikal
