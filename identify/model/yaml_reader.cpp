#include "identify/model/yaml_reader.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <system_error>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/exceptions.h>
#include <yaml-cpp/mark.h>
#include <yaml-cpp/parser.h>

#include "lib/base/nearest_name.h"
#include "lib/base/utf8.h"

namespace identikal {
namespace {

constexpr std::size_t kMaxBytes = 1'000'000;
constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
constexpr std::size_t kMaxNodes = 100'000;
constexpr std::size_t kMaxDepth = 32;

}  // namespace

std::string read_yaml_text(const std::string& path) {
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) {
    throw InputError({path}, "is a directory", "a model file");
  }
  errno = 0;
  std::ifstream file(path, std::ios::binary);
  if (!file) {
    const int reason = errno;
    throw InputError({path}, fmt::format("cannot be opened: {}", std::strerror(reason)));
  }
  std::string text;
  for (char chunk[4096]; file && text.size() <= kMaxBytes;) {
    file.read(chunk, sizeof chunk);
    text.append(chunk, static_cast<std::size_t>(file.gcount()));
  }
  if (file.bad()) throw InputError({path}, "cannot be read");
  if (text.size() > kMaxBytes) {
    throw InputError({path}, "is larger than 1 MB", "a model file, not a recording");
  }
  return text;
}

namespace {

bool is_control(char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f; }

// The text, and the way from yaml-cpp's marks (line and byte, from 0) to a person's (line and
// character, from 1).
class Source {
 public:
  Source(std::string path, const std::string& text) : path_(std::move(path)), text_(text) {
    characters_.reserve(text_.size() + 1);
    int character = 0;
    for (std::size_t i = 0; i < text_.size(); ++character) {
      const std::size_t length = utf8_length(text_, i);
      const char c = text_[i];
      characters_.insert(characters_.end(), std::max<std::size_t>(length, 1), character);
      if (length == 0 || (is_control(c) && c != '\n' && c != '\r' && c != '\t')) {
        throw InputError(
            {path_, static_cast<int>(lines_.size()), character - characters_[lines_.back()] + 1},
            fmt::format("byte 0x{:02x} is not text", static_cast<unsigned char>(c)),
            "a YAML file in UTF-8");
      }
      i += length;
      if (c == '\n') lines_.push_back(i);
    }
    characters_.push_back(character);
  }

  const std::string& text() const { return text_; }

  Location place(const YAML::Mark& mark) const {
    return mark.is_null() ? Location{path_} : place_of(byte_at(mark));
  }

  // A tab among the blanks that a line (from 1) begins with.
  std::optional<Location> indenting_tab(int line) const {
    if (line < 1 || static_cast<std::size_t>(line) > lines_.size()) return std::nullopt;
    const std::size_t at = text_.find_first_not_of(' ', lines_[static_cast<std::size_t>(line) - 1]);
    if (at == std::string::npos || text_[at] != '\t') return std::nullopt;
    return place_of(at);
  }

  // Where a scalar's text stands: past its quote, and on every line that it was folded from. Ends
  // at an escape, which is not what it stands for.
  std::vector<YamlNode::Line> lines_of(const YAML::Mark& mark, std::string_view value) const {
    std::size_t at = byte_at(mark);
    const bool quoted = at < text_.size() && (text_[at] == '"' || text_[at] == '\'');
    if (!quoted && std::string_view(text_).substr(at).starts_with(value)) return {};
    at += quoted ? 1 : 0;
    std::vector<YamlNode::Line> out{{1, place_of(at)}};
    int character = 1;
    for (const char c : value) {
      if (at >= text_.size()) break;
      const std::size_t next = text_.find_first_not_of(" \t\r\n", at);
      const bool folded = c == ' ' && next != std::string::npos &&
                          std::find(text_.begin() + static_cast<std::ptrdiff_t>(at),
                                    text_.begin() + static_cast<std::ptrdiff_t>(next),
                                    '\n') != text_.begin() + static_cast<std::ptrdiff_t>(next);
      if (!folded && text_[at] != c) break;
      if (!is_utf8_continuation(c)) ++character;
      at = folded ? next : at + 1;
      if (folded) out.push_back({character, place_of(at)});
    }
    return out;
  }

 private:
  std::size_t byte_at(const YAML::Mark& mark) const {
    const std::size_t line = std::min(static_cast<std::size_t>(mark.line), lines_.size() - 1);
    return std::min(lines_[line] + static_cast<std::size_t>(mark.column), text_.size());
  }

  Location place_of(std::size_t byte) const {
    const auto line = std::upper_bound(lines_.begin(), lines_.end(), byte) - 1;
    return {path_, static_cast<int>(line - lines_.begin()) + 1,
            characters_[byte] - characters_[*line] + 1};
  }

  std::string path_;
  const std::string& text_;
  std::vector<std::size_t> lines_{0};  // first byte of each line
  std::vector<int> characters_;        // how many characters stand before each byte, and at the end
};

// yaml-cpp hands its events out through this interface. Building the tree from them, rather than
// taking YAML::Node, keeps the places of keys, sees duplicates and aliases, and stops a deeply
// nested file before the parser's own recursion does harm.
class TreeBuilder final : public YAML::EventHandler {
 public:
  explicit TreeBuilder(const Source& source) : source_(source) {}

  YamlNode root;

  void OnDocumentStart(const YAML::Mark& mark) override {
    if (++documents_ > 1) fail(mark, "a second YAML document starts here", "one model per file");
  }
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark& mark, YAML::anchor_t) override {
    place_child(node(mark, YamlNode::Kind::empty));
  }
  void OnAlias(const YAML::Mark& mark, YAML::anchor_t) override {
    fail(mark, "YAML aliases ('*name') are not supported", "the value itself");
  }
  void OnScalar(const YAML::Mark& mark, const std::string&, YAML::anchor_t,
                const std::string& value) override {
    if (std::any_of(value.begin(), value.end(), is_control)) {
      fail(mark, in_quotes(value) + " holds a line break or a control character",
           "text on one line");
    }
    YamlNode scalar = node(mark, YamlNode::Kind::scalar);
    scalar.text = value;
    scalar.lines = source_.lines_of(mark, value);
    place_child(std::move(scalar));
  }
  void OnSequenceStart(const YAML::Mark& mark, const std::string&, YAML::anchor_t,
                       YAML::EmitterStyle::value) override {
    open(node(mark, YamlNode::Kind::list));
  }
  void OnSequenceEnd() override { close(); }
  void OnMapStart(const YAML::Mark& mark, const std::string&, YAML::anchor_t,
                  YAML::EmitterStyle::value) override {
    open(node(mark, YamlNode::Kind::mapping));
  }
  void OnMapEnd() override {
    check_duplicates(open_.back());
    close();
  }

 private:
  [[noreturn]] void fail(const YAML::Mark& mark, const std::string& found,
                         const std::string& expected) const {
    throw InputError(source_.place(mark), found, expected);
  }

  YamlNode node(const YAML::Mark& mark, YamlNode::Kind kind) {
    if (++nodes_ > kMaxNodes) {
      fail(mark, "the file holds too many values", fmt::format("at most {}", kMaxNodes));
    }
    YamlNode out;
    out.kind = kind;
    out.at = source_.place(mark);
    return out;
  }

  void open(YamlNode child) {
    if (open_.size() == kMaxDepth) {
      throw InputError(child.at, "nested too deeply", fmt::format("at most {} levels", kMaxDepth));
    }
    open_.push_back(std::move(child));
  }

  void close() {
    YamlNode child = std::move(open_.back());
    open_.pop_back();
    place_child(std::move(child));
  }

  void place_child(YamlNode child) {
    if (open_.empty()) {
      root = std::move(child);
      return;
    }
    YamlNode& parent = open_.back();
    if (parent.kind == YamlNode::Kind::list || parent.keys.size() > parent.items.size()) {
      parent.items.push_back(std::move(child));
      return;
    }
    if (child.kind != YamlNode::Kind::scalar) {
      throw InputError(child.at, "a key is " + describe(child), "a word before the colon");
    }
    parent.keys.push_back(std::move(child));
  }

  static void check_duplicates(const YamlNode& mapping) {
    std::map<std::string_view, int> line_of;
    for (const YamlNode& key : mapping.keys) {
      const auto [first, is_new] = line_of.try_emplace(key.text, key.at.line);
      if (!is_new) {
        throw InputError(key.at, fmt::format("key {} is given twice", in_quotes(key.text)), "",
                         fmt::format("the first is on line {}", first->second));
      }
    }
  }

  const Source& source_;
  std::vector<YamlNode> open_;
  std::size_t nodes_ = 0;
  int documents_ = 0;
};

void check_word(const std::string& word, const Location& at, const std::string& unknown,
                const std::vector<std::string>& known, const std::vector<std::string>& not_yet) {
  const auto holds = [&word](const std::vector<std::string>& list) {
    return std::find(list.begin(), list.end(), word) != list.end();
  };
  if (holds(known)) return;
  const std::string choice = fmt::format("{}", fmt::join(known, ", "));
  if (holds(not_yet)) {
    throw InputError(at, in_quotes(word) + " is not available yet", "", "known: " + choice);
  }
  if (known.size() == 1) throw InputError(at, unknown, choice);
  throw InputError(at, unknown, "one of " + choice, did_you_mean(word, known));
}

}  // namespace

YamlNode read_yaml(const std::string& path) { return parse_yaml(read_yaml_text(path), path); }

YamlNode parse_yaml(const std::string& text, const std::string& path) {
  // Or columns on line 1 would be off.
  if (text.starts_with(kByteOrderMark)) return parse_yaml(text.substr(kByteOrderMark.size()), path);
  const Source source(path, text);
  TreeBuilder tree(source);
  try {
    std::istringstream stream(source.text());
    YAML::Parser parser(stream);
    while (parser.HandleNextDocument(tree)) {
    }
  } catch (const YAML::Exception& error) {
    const Location at = source.place(error.mark);
    // What yaml-cpp makes of a tab differs from place to place, and few of its words say "tab".
    const std::optional<Location> tab = source.indenting_tab(at.line);
    if (tab && error.msg.find("tab") == std::string::npos) {
      throw InputError(*tab, "a tab in the indentation", "blanks", error.msg);
    }
    throw InputError(at, "not valid YAML: " + error.msg);
  }
  if (tree.root.kind == YamlNode::Kind::empty) {
    throw InputError({path}, "is empty", "a model file, which starts with 'identikal: 1'");
  }
  return std::move(tree.root);
}

std::optional<std::array<std::size_t, 2>> extent_of(const YamlNode& node, const std::string& text) {
  std::size_t begin = 0;
  for (int line = 1; line < node.at.line; ++line) begin = text.find('\n', begin) + 1;
  for (int column = 1; column < node.at.column; ++column) {
    begin += std::max<std::size_t>(utf8_length(text, begin), 1);
  }
  const auto end_of_quotes = [&](std::size_t at) {
    const char quote = text[at++];
    for (; at < text.size(); ++at) {
      if (quote == '"' && text[at] == '\\') {
        ++at;
      } else if (text[at] == quote) {
        if (quote == '"' || at + 1 >= text.size() || text[at + 1] != quote) break;
        ++at;
      }
    }
    return at + 1;
  };
  if (begin >= text.size()) return std::nullopt;
  const char first = text[begin];
  if (node.kind == YamlNode::Kind::scalar) {
    if (first == '"' || first == '\'') return {{begin, end_of_quotes(begin)}};
    if (text.compare(begin, node.text.size(), node.text) != 0) return std::nullopt;
    return {{begin, begin + node.text.size()}};
  }
  if (node.kind != YamlNode::Kind::list || node.items.empty()) return std::nullopt;
  if (first != '[') {  // a row per "- "
    const auto last = extent_of(node.items.back(), text);
    if (!last) return std::nullopt;
    return {{begin, (*last)[1]}};
  }
  int open = 0;
  for (std::size_t at = begin; at < text.size(); ++at) {
    if (text[at] == '"' || text[at] == '\'') at = end_of_quotes(at) - 1;
    if (text[at] == '[') ++open;
    if (text[at] == ']' && --open == 0) return {{begin, at + 1}};
  }
  return std::nullopt;
}

const YamlNode* find(const YamlNode& mapping, std::string_view key) {
  const auto hit = std::find_if(mapping.keys.begin(), mapping.keys.end(),
                                [key](const YamlNode& k) { return k.text == key; });
  return hit == mapping.keys.end() ? nullptr : &mapping.items[hit - mapping.keys.begin()];
}

const YamlNode& required(const YamlNode& mapping, std::string_view key, const std::string& what,
                         const std::string& example) {
  const YamlNode* node = find(mapping, key);
  if (node == nullptr) {
    throw InputError(mapping.at, fmt::format("'{}' is missing in {}", key, what), example);
  }
  return *node;
}

void check_mapping(const YamlNode& node, const std::string& what) {
  if (node.kind != YamlNode::Kind::mapping) {
    throw InputError(node.at, fmt::format("{} is {}", what, describe(node)),
                     "a mapping of 'key: value'");
  }
  for (std::size_t i = 0; i < node.keys.size(); ++i) {
    if (node.items[i].kind == YamlNode::Kind::empty) {
      throw InputError(node.keys[i].at,
                       fmt::format("{} in {} has no value", in_quotes(node.keys[i].text), what));
    }
  }
}

void check_keys(const YamlNode& node, const std::string& what,
                const std::vector<std::string>& known, const std::vector<std::string>& not_yet) {
  if (node.kind == YamlNode::Kind::mapping) {
    for (const YamlNode& key : node.keys) {
      check_word(key.text, key.at, fmt::format("unknown key {} in {}", in_quotes(key.text), what),
                 known, not_yet);
    }
  }
  check_mapping(node, what);
}

const std::string& text_of(const YamlNode& node, const std::string& what) {
  if (node.kind != YamlNode::Kind::scalar || node.text.empty()) {
    throw InputError(node.at, fmt::format("{} is {}", what, describe(node)), "a single value");
  }
  return node.text;
}

const std::string& word_of(const YamlNode& node, const std::string& what,
                           const std::vector<std::string>& known,
                           const std::vector<std::string>& not_yet) {
  const std::string& word = text_of(node, what);
  check_word(word, node.at, fmt::format("{} is {}", what, in_quotes(word)), known, not_yet);
  return word;
}

Location place_in(const YamlNode& scalar, int character) {
  Location out = scalar.at;
  int first = 1;
  for (const YamlNode::Line& line : scalar.lines) {
    if (line.character > std::max(character, 1)) break;
    out = line.at;
    first = line.character;
  }
  if (out.column > 0 && character > 0) out.column += character - first;
  return out;
}

std::string describe(const YamlNode& node) {
  switch (node.kind) {
    case YamlNode::Kind::empty:
      return "empty";
    case YamlNode::Kind::scalar:
      return in_quotes(node.text);
    case YamlNode::Kind::list:
      return "a list";
    case YamlNode::Kind::mapping:
      return "a mapping";
  }
  return "";
}

std::string in_quotes(std::string_view text) {
  constexpr std::size_t kShown = 60;
  if (text.size() <= kShown) return fmt::format("'{}'", text);
  std::size_t cut = kShown;
  while (cut > 0 && is_utf8_continuation(text[cut])) --cut;
  return fmt::format("'{}...'", text.substr(0, cut));
}

}  // namespace identikal
