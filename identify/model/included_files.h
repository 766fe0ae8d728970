// What does a model file take from other files?
#pragma once

#include <map>
#include <string>
#include <vector>

#include "identify/model/yaml_reader.h"

namespace identikal {

/// Texts of files by their path, as they were read first: whoever asks again gets the same bytes.
using FileTexts = std::map<std::string, std::string>;

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
/// @param read  what was read before; files that it lacks are read and put there
/// @throws InputError also for an included file that cannot be opened, includes itself, or is
///   nested deeper than eight files, and for more than a hundred of them
YamlNode parse_with_included(const std::string& text, const std::string& path, FileTexts& read);
YamlNode parse_with_included(const std::string& text, const std::string& path);

/// Paths of the files that it includes, and of those that they include.
std::vector<std::string> included_files(const std::string& text, const std::string& path,
                                        FileTexts& read);
std::vector<std::string> included_files(const std::string& text, const std::string& path);

}  // namespace identikal
