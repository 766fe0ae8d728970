// How is a tree of keys and values made, and written as text again?
#pragma once

#include <string>

#include "identify/model/yaml_reader.h"

namespace identikal {

YamlNode yaml_scalar(std::string text);
/// That stands where `at` does.
YamlNode yaml_scalar(std::string text, const YamlNode& at);
YamlNode yaml_list();
YamlNode yaml_mapping();
/// Behind the others of a mapping.
void append(YamlNode& mapping, const std::string& key, YamlNode value);
/// The value of a key; a mapping is put there where there is none.
YamlNode& value_at(YamlNode& mapping, const std::string& key);

/// YAML text that parse_yaml() reads as this tree: the outer mapping line by line, as are the first
/// of its own; the rest in braces and brackets.
std::string yaml_text(const YamlNode& root);

}  // namespace identikal
