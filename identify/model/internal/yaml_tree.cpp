#include "identify/model/internal/yaml_tree.h"

#include <algorithm>
#include <cctype>
#include <utility>

namespace identikal {
namespace {

using Kind = YamlNode::Kind;

// Plain where that reads as the same text.
std::string scalar_text(const std::string& text) {
  const bool plain = !text.empty() && text.front() != '-' &&
                     std::all_of(text.begin(), text.end(), [](unsigned char c) {
                       return std::isalnum(c) != 0 || c == '_' || c == '.' || c == '/' ||
                              c == '^' || c == '+' || c == '-' || c == ' ';
                     });
  if (plain && text.front() != ' ' && text.back() != ' ') return text;
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    out += c;
  }
  return out + '"';
}

std::string flow_text(const YamlNode& node) {
  if (node.kind == Kind::scalar) return scalar_text(node.text);
  if (node.kind == Kind::empty) return "";
  const bool is_list = node.kind == Kind::list;
  std::string out = is_list ? "[" : "{";
  for (std::size_t i = 0; i < node.items.size(); ++i) {
    if (i > 0) out += ", ";
    if (!is_list) out += scalar_text(node.keys[i].text) + ": ";
    out += flow_text(node.items[i]);
  }
  return out + (is_list ? "]" : "}");
}

}  // namespace

YamlNode yaml_scalar(std::string text) {
  YamlNode out;
  out.kind = Kind::scalar;
  out.text = std::move(text);
  return out;
}

YamlNode yaml_scalar(std::string text, const YamlNode& at) {
  YamlNode out = yaml_scalar(std::move(text));
  out.at = at.at;
  return out;
}

YamlNode yaml_list() {
  YamlNode out;
  out.kind = Kind::list;
  return out;
}

YamlNode yaml_mapping() {
  YamlNode out;
  out.kind = Kind::mapping;
  return out;
}

void append(YamlNode& mapping, const std::string& key, YamlNode value) {
  mapping.kind = Kind::mapping;
  mapping.keys.push_back(yaml_scalar(key));
  mapping.items.push_back(std::move(value));
}

YamlNode& value_at(YamlNode& mapping, const std::string& key) {
  for (std::size_t i = 0; i < mapping.keys.size(); ++i) {
    if (mapping.keys[i].text == key) return mapping.items[i];
  }
  append(mapping, key, yaml_mapping());
  return mapping.items.back();
}

std::string yaml_text(const YamlNode& root) {
  std::string out;
  for (std::size_t i = 0; i < root.items.size(); ++i) {
    const YamlNode& item = root.items[i];
    out += scalar_text(root.keys[i].text) + ":";
    if (item.kind != Kind::mapping) {
      out += " " + flow_text(item) + "\n";
      continue;
    }
    out += "\n";
    for (std::size_t j = 0; j < item.items.size(); ++j) {
      out += "  " + scalar_text(item.keys[j].text) + ": " + flow_text(item.items[j]) + "\n";
    }
  }
  return out;
}

}  // namespace identikal
