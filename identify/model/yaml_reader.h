// What stands where in a YAML file? A tree that remembers the place of every key and value, and the
// checks that yaml-cpp leaves out: unknown, duplicate and empty keys, depth, size, text encoding.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "lib/base/error.h"

namespace identikal {

struct YamlNode {
  enum class Kind { empty, scalar, list, mapping };
  Kind kind = Kind::empty;
  Location at;
  std::string text;  ///< of a scalar: UTF-8 on one line, without control characters
  /// Of a scalar that is quoted or written over several lines: where its text stands, line by line.
  struct Line {
    int character;  ///< of the text, from 1, that the line begins with
    Location at;
  };
  std::vector<Line> lines;
  std::vector<YamlNode> keys;   ///< of a mapping, as long as `items`: distinct scalars
  std::vector<YamlNode> items;  ///< values of a list or a mapping, in the order of the file
};

/// Reads a file that holds one YAML document; the root is never empty.
/// @throws InputError when the file cannot be read, is larger than 1 MB, is not UTF-8 text or not
/// YAML,
///   is nested deeper than 32 levels, holds an alias, a second document or the same key twice.
YamlNode read_yaml(const std::string& path);

/// The same from the file's text, behind a byte order mark or not. @param path  for messages
///
/// Example:
///
///     const YamlNode root = parse_yaml("name: level\nA: [[1]]", "level.yaml");
///     if (const YamlNode* A = find(root, "A")) std::printf("A stands in line %d\n", A->at.line);
YamlNode parse_yaml(const std::string& text, const std::string& path);

/// A model file's bytes.
/// @throws InputError when it cannot be read or is larger than 1 MB
std::string read_yaml_text(const std::string& path);

/// Bytes [begin, end) of the text that parse_yaml() read this scalar or list from, brackets and
/// quotes included. Nothing where it is a scalar written over several lines.
std::optional<std::array<std::size_t, 2>> extent_of(const YamlNode& node, const std::string& text);

/// The value of a key, or nullptr.
const YamlNode* find(const YamlNode& mapping, std::string_view key);

/// The value of a key that must be there. `what` names the mapping, `example` shows what to write.
const YamlNode& required(const YamlNode& mapping, std::string_view key, const std::string& what,
                         const std::string& example);

/// Throws unless the node is a mapping whose values are all given.
void check_mapping(const YamlNode& node, const std::string& what);

/// check_mapping, and throws at the first key that is not in `known`; keys in `not_yet` are refused
/// as such rather than as a spelling mistake.
void check_keys(const YamlNode& node, const std::string& what,
                const std::vector<std::string>& known,
                const std::vector<std::string>& not_yet = {});

/// The text of a scalar that is not empty.
const std::string& text_of(const YamlNode& node, const std::string& what);

/// The text of a scalar that must be one of a few words.
const std::string& word_of(const YamlNode& node, const std::string& what,
                           const std::vector<std::string>& known,
                           const std::vector<std::string>& not_yet = {});

/// Where a character of a scalar's text stands. @param character  from 1; 0: the text as a whole
Location place_in(const YamlNode& scalar, int character);

/// What was found there, for a message: "'text'" (long text is cut), "a list", "a mapping",
/// "nothing".
std::string describe(const YamlNode& node);
std::string in_quotes(std::string_view text);

}  // namespace identikal
