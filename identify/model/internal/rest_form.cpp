#include "identify/model/internal/rest_form.h"

#include <utility>

#include "identify/model/internal/yaml_tree.h"
#include "identify/model/model_values.h"

namespace identikal {
namespace {

constexpr const char* kSteadyState = "steady-state";

}  // namespace

const YamlNode* steady_state_start(const YamlNode& root) {
  const YamlNode* kind = find(root, "initial");
  if (kind != nullptr && kind->kind == YamlNode::Kind::mapping) kind = find(*kind, "kind");
  const bool says =
      kind != nullptr && kind->kind == YamlNode::Kind::scalar && kind->text == kSteadyState;
  return says ? kind : nullptr;
}

std::vector<std::optional<double>> inputs_at_rest(const YamlNode& root,
                                                  const std::vector<ChannelSource>& inputs) {
  std::vector<std::optional<double>> out(inputs.size());
  const YamlNode& initial = *find(root, "initial");
  if (initial.kind != YamlNode::Kind::mapping) return out;
  check_keys(initial, "initial", {"kind", "inputs", "mean", "sd", "covariance"});
  const YamlNode* given = find(initial, "inputs");
  if (given == nullptr) return out;
  std::vector<std::string> names;
  for (const ChannelSource& input : inputs) names.push_back(input.name);
  check_keys(*given, "inputs", names);
  for (std::size_t i = 0; i < names.size(); ++i) {
    const YamlNode* value = find(*given, names[i]);
    if (value != nullptr) out[i] = read_si(*value, inputs[i].unit, in_quotes(names[i]));
  }
  return out;
}

YamlNode with_start_at_rest(YamlNode root, const std::vector<StateName>& states) {
  YamlNode& initial = value_at(root, "initial");
  YamlNode rest = yaml_mapping();
  rest.at = initial.at;
  for (std::size_t i = 0; i < initial.keys.size(); ++i) {
    const std::string& key = initial.keys[i].text;
    if (key == "kind" || key == "inputs") continue;
    rest.keys.push_back(initial.keys[i]);
    rest.items.push_back(initial.items[i]);
  }
  initial = std::move(rest);
  if (find(initial, "mean") == nullptr) {
    YamlNode& mean = value_at(initial, "mean");
    for (const StateName& state : states) append(mean, state.name, yaml_scalar("0", initial));
  }
  return root;
}

bool has_infinity(const YamlNode& root) {
  const YamlNode* time = find(root, "time");
  const YamlNode* node = time == nullptr ? nullptr : find(*time, "infinity");
  if (node == nullptr) return false;
  word_of(*node, "infinity", {kSteadyState});
  const YamlNode* sampling = find(*time, "sampling");
  if (sampling == nullptr || sampling->text != "irregular") {
    throw InputError(node->at, "infinity on a grid of samples", "sampling: irregular");
  }
  return true;
}

void refuse_moving_noise(const YamlNode& root, const std::string& what) {
  const auto refuse = [&](const YamlNode* node) {
    if (node == nullptr) return;
    throw InputError(node->at, "noise that moves states beside " + what,
                     "states that follow from their start alone");
  };
  refuse(find(root, "Q"));
  if (const YamlNode* noise = find(root, "noise")) refuse(find(*noise, "process"));
  const YamlNode* initial = find(root, "initial");
  if (initial == nullptr || initial->kind != YamlNode::Kind::mapping) return;
  refuse(find(*initial, "sd"));
  refuse(find(*initial, "covariance"));
}

}  // namespace identikal
