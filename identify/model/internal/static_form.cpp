#include "identify/model/internal/static_form.h"

#include <algorithm>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "identify/model/internal/yaml_tree.h"

namespace identikal {
namespace {

constexpr const char* kStill = "no_state";

void refuse_motion(const YamlNode& root) {
  for (const char* key : {"states", "dynamics", "initial", "components", "A", "B", "C", "D", "G",
                          "Q", "S", "reference", "use_when", "doses"}) {
    const auto at = std::find_if(root.keys.begin(), root.keys.end(),
                                 [&](const YamlNode& each) { return each.text == key; });
    if (at == root.keys.end()) continue;
    throw InputError(at->at, fmt::format("'{}' does not belong to model: static", key),
                     "outputs that are formulas of inputs and parameters");
  }
  const YamlNode* noise = find(root, "noise");
  if (const YamlNode* process = noise != nullptr ? find(*noise, "process") : nullptr) {
    throw InputError(process->at, "process noise does not belong to model: static",
                     "noise: {measurement: {sd: {...}}}");
  }
}

void set_time(YamlNode& root) {
  YamlNode& time = value_at(root, "time");
  if (const YamlNode* kind = find(time, "kind"); kind != nullptr && kind->text == "continuous") {
    throw InputError(kind->at, "kind is 'continuous', and model: static has no motion",
                     "no kind, or no time at all");
  }
  if (find(time, "kind") == nullptr) append(time, "kind", yaml_scalar("discrete"));
  if (find(time, "column") == nullptr && find(time, "step") == nullptr) {
    append(time, "step", yaml_scalar("1 s"));
  }
}

}  // namespace

YamlNode with_still_state(YamlNode root) {
  if (root.kind != YamlNode::Kind::mapping) return root;
  const YamlNode* model = find(root, "model");
  if (model == nullptr || model->text != "static") return root;
  refuse_motion(root);
  const auto at = model - root.items.data();
  root.keys.erase(root.keys.begin() + at);
  root.items.erase(root.items.begin() + at);
  set_time(root);
  append(value_at(root, "states"), kStill, yaml_scalar("1"));
  append(value_at(root, "dynamics"), kStill, yaml_scalar(kStill));
  append(value_at(value_at(root, "initial"), "mean"), kStill, yaml_scalar("0"));
  return root;
}

}  // namespace identikal
