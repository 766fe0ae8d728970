#include "identify/model/included_files.h"

#include <algorithm>
#include <filesystem>
#include <vector>

#include <fmt/format.h>

namespace identikal {
namespace {

constexpr std::size_t kMaxFiles = 8;        // one within another
constexpr std::size_t kMostIncluded = 100;  // in all

// Entries of `other` that `own` does not have, before its own: a definition may use them.
void put_before(YamlNode& own, const YamlNode& other) {
  std::vector<YamlNode> keys, items;
  for (std::size_t i = 0; i < other.keys.size(); ++i) {
    if (find(own, other.keys[i].text) != nullptr) continue;
    keys.push_back(other.keys[i]);
    items.push_back(other.items[i]);
  }
  own.keys.insert(own.keys.begin(), keys.begin(), keys.end());
  own.items.insert(own.items.begin(), items.begin(), items.end());
}

void merge(YamlNode& root, const YamlNode& included) {
  for (std::size_t i = 0; i < included.keys.size(); ++i) {
    const std::string& key = included.keys[i].text;
    const auto own = std::find_if(root.keys.begin(), root.keys.end(),
                                  [&](const YamlNode& k) { return k.text == key; });
    if (own == root.keys.end()) {
      root.keys.push_back(included.keys[i]);
      root.items.push_back(included.items[i]);
      continue;
    }
    YamlNode& item = root.items[own - root.keys.begin()];
    const bool mappings =
        item.kind == YamlNode::Kind::mapping && included.items[i].kind == YamlNode::Kind::mapping;
    if (mappings && (key == "parameters" || key == "let")) put_before(item, included.items[i]);
  }
}

struct Walk {
  FileTexts& read;
  std::vector<std::filesystem::path> open = {};  // the files that include this one
  std::vector<std::string> met = {};             // all that were included so far
};

const std::string& text_of_included(const std::string& path, FileTexts& read) {
  const auto known = read.find(path);
  return known != read.end() ? known->second
                             : read.emplace(path, read_yaml_text(path)).first->second;
}

YamlNode with_included(YamlNode root, const std::string& path, Walk& walk) {
  std::vector<std::filesystem::path>& open = walk.open;
  const YamlNode* include = find(root, "include");
  if (include == nullptr) return root;
  const YamlNode named = *include;
  const auto at = include - root.items.data();
  root.keys.erase(root.keys.begin() + at);
  root.items.erase(root.items.begin() + at);
  const std::vector<YamlNode> files =
      named.kind == YamlNode::Kind::list ? named.items : std::vector<YamlNode>{named};
  open.push_back(std::filesystem::weakly_canonical(path));
  for (const YamlNode& file : files) {
    const std::filesystem::path target =
        std::filesystem::path(path).parent_path() / text_of(file, "include");
    std::error_code ignored;
    if (!walk.read.contains(target.string()) && !std::filesystem::exists(target, ignored)) {
      throw InputError(file.at, fmt::format("include {} does not exist", describe(file)),
                       "a file, relative to this one");
    }
    if (std::find(open.begin(), open.end(), std::filesystem::weakly_canonical(target)) !=
        open.end()) {
      throw InputError(file.at, fmt::format("include {} comes back to itself", describe(file)));
    }
    if (open.size() == kMaxFiles) {
      throw InputError(file.at, "files are included too deeply",
                       fmt::format("at most {}", kMaxFiles));
    }
    if (walk.met.size() == kMostIncluded) {
      throw InputError(file.at, "too many files are included",
                       fmt::format("at most {} in all", kMostIncluded));
    }
    walk.met.push_back(target.string());
    const YamlNode included =
        with_included(parse_yaml(text_of_included(target.string(), walk.read), target.string()),
                      target.string(), walk);
    check_mapping(included, "an included file");
    merge(root, included);
  }
  open.pop_back();
  return root;
}

}  // namespace

YamlNode parse_with_included(const std::string& text, const std::string& path, FileTexts& read) {
  Walk walk{read};
  return with_included(parse_yaml(text, path), path, walk);
}

YamlNode parse_with_included(const std::string& text, const std::string& path) {
  FileTexts read;
  return parse_with_included(text, path, read);
}

std::vector<std::string> included_files(const std::string& text, const std::string& path,
                                        FileTexts& read) {
  if (text.find("include") == std::string::npos)
    return {};  // most have none, and parsing takes time
  Walk walk{read};
  with_included(parse_yaml(text, path), path, walk);
  return walk.met;
}

std::vector<std::string> included_files(const std::string& text, const std::string& path) {
  FileTexts read;
  return included_files(text, path, read);
}

}  // namespace identikal
