#include "identify/model/sensors.h"

#include <algorithm>
#include <cstddef>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "identify/model/extension.h"
#include "identify/model/internal/yaml_tree.h"
#include "identify/model/model_values.h"
#include "lib/base/nearest_name.h"
#include "lib/data/units.h"

namespace identikal {
namespace {

using Kind = YamlNode::Kind;

constexpr const char* kExample = "sensors: {gps: {bias: free, error: markov}}";

std::vector<std::string> channels_of(const YamlNode& root) {
  std::vector<std::string> out;
  for (const char* key : {"outputs", "inputs"}) {
    const YamlNode* channels = find(root, key);
    if (channels == nullptr || channels->kind != Kind::mapping) continue;
    for (const YamlNode& name : channels->keys) out.push_back(name.text);
  }
  return out;
}

// The time between samples, where the file knows it.
double step_of(const YamlNode& root, const YamlNode& sensor) {
  const YamlNode* time = find(root, "time");
  const YamlNode* step = time != nullptr ? find(*time, "step") : nullptr;
  if (step != nullptr) {
    const YamlNode* unit = find(*time, "unit");
    return read_si(*step, unit != nullptr ? unit->text : "s", "step");
  }
  if (has_continuous_time(root)) return 1.0;
  throw InputError(sensor.at, "an error that lasts, in discrete time without a step",
                   "time: {step: 0.1 s}");
}

// Takes a parameter out of the file's own; nothing where it has none of that name.
std::optional<YamlNode> take_parameter(YamlNode& root, const std::string& name) {
  if (find(root, "parameters") == nullptr) return std::nullopt;
  YamlNode& all = value_at(root, "parameters");
  for (std::size_t i = 0; i < all.keys.size(); ++i) {
    if (all.keys[i].text != name) continue;
    YamlNode out = all.items[i];
    all.keys.erase(all.keys.begin() + static_cast<std::ptrdiff_t>(i));
    all.items.erase(all.items.begin() + static_cast<std::ptrdiff_t>(i));
    return out;
  }
  return std::nullopt;
}

// What the second one says of a parameter, and what it leaves to the first.
void say_more(YamlNode& parameter, const YamlNode& more) {
  if (more.kind != Kind::mapping || parameter.kind != Kind::mapping) {
    parameter = more;
    return;
  }
  for (std::size_t i = 0; i < more.keys.size(); ++i) {
    value_at(parameter, more.keys[i].text) = more.items[i];
    for (YamlNode& key : parameter.keys) {
      if (key.text == more.keys[i].text) key.at = more.keys[i].at;  // for messages
    }
  }
}

// @param given  under `sensors`, may be null
// @param own    under `parameters`: goes first
void write_parameter(YamlNode& root, const std::string& name, const YamlNode* given,
                     const std::optional<YamlNode>& own) {
  YamlNode& parameter = value_at(value_at(root, "parameters"), name);
  const bool free = given == nullptr || (given->kind == Kind::scalar && given->text == "free");
  if (!free) say_more(parameter, *given);
  if (own) say_more(parameter, *own);
}

// A bias, scale or delay.
YamlNode with_constant(YamlNode root, ExtensionKind kind, const std::string& name,
                       const std::string& channel, const YamlNode& given) {
  if (kind == ExtensionKind::delay &&
      (find(*find(root, "outputs"), channel) == nullptr || !can_be_late(root, channel))) {
    throw InputError(given.at, fmt::format("a delay of '{}'", channel),
                     "continuous time, and an output that is written in states that move and "
                     "parameters; an input has its own `delay: NAME`");
  }
  const std::optional<YamlNode> own = take_parameter(root, name);
  root = extended(std::move(root), {kind, {channel}, {1.0}}, 1.0);
  write_parameter(root, name, &given, own);
  return root;
}

YamlNode with_lasting_error(YamlNode root, const std::string& channel, const YamlNode& given) {
  const std::string sd = "sd_" + channel, tau = "tau_" + channel;
  if (find(*find(root, "dynamics"), "error_" + channel) != nullptr) {
    throw InputError(given.at, fmt::format("makes a state 'error_{}', which is there", channel),
                     "one of both");
  }
  const YamlNode* outputs = find(root, "outputs");
  const YamlNode* node = find(*outputs, channel);
  if (node == nullptr) node = find(*find(root, "inputs"), channel);
  const YamlNode* unit = find(*node, "unit");
  const double one = unit_or_dimensionless(unit != nullptr ? unit->text : "").scale;
  const double step = step_of(root, given);
  const std::optional<YamlNode> own_sd = take_parameter(root, sd),
                                own_tau = take_parameter(root, tau);
  root = extended(std::move(root), {ExtensionKind::lasting_error, {channel}, {one}}, step);
  const bool by_name = given.kind == Kind::scalar;
  if (by_name) word_of(given, "error", {"markov"});
  if (!by_name) check_keys(given, "error", {"sd", "tau"});
  write_parameter(root, sd, by_name ? nullptr : find(given, "sd"), own_sd);
  write_parameter(root, tau, by_name ? nullptr : find(given, "tau"), own_tau);
  return root;
}

// From the state outwards: late, then scaled, then off.
YamlNode with_sensor(YamlNode root, const std::string& channel, const YamlNode& sensor) {
  check_keys(sensor, "sensors: " + channel, {"bias", "scale", "delay", "error"});
  struct Part {
    const char* key;
    ExtensionKind kind;
  };
  for (const Part& part : {Part{"delay", ExtensionKind::delay}, Part{"scale", ExtensionKind::scale},
                           Part{"bias", ExtensionKind::bias}}) {
    const YamlNode* given = find(sensor, part.key);
    if (given == nullptr) continue;
    root = with_constant(std::move(root), part.kind, fmt::format("{}_{}", part.key, channel),
                         channel, *given);
  }
  const YamlNode* error = find(sensor, "error");
  return error != nullptr ? with_lasting_error(std::move(root), channel, *error) : root;
}

}  // namespace

YamlNode with_sensors(YamlNode root) {
  const YamlNode* written = find(root, "sensors");
  const YamlNode* dynamics = find(root, "dynamics");
  const YamlNode* outputs = find(root, "outputs");
  if (written == nullptr || dynamics == nullptr || dynamics->kind != Kind::mapping ||
      outputs == nullptr || outputs->kind != Kind::mapping) {
    return root;
  }
  const YamlNode sensors = *written;
  check_mapping(sensors, "sensors");
  if (const YamlNode* parameters = find(root, "parameters"))
    check_mapping(*parameters, "parameters");
  const auto at = static_cast<std::ptrdiff_t>(written - root.items.data());
  root.items.erase(root.items.begin() + at);
  root.keys.erase(root.keys.begin() + at);
  for (std::size_t i = 0; i < sensors.keys.size(); ++i) {
    const std::string& name = sensors.keys[i].text;
    const std::vector<std::string> known = channels_of(root);
    if (std::find(known.begin(), known.end(), name) == known.end()) {
      const std::string hint = did_you_mean(name, known);
      throw InputError(sensors.keys[i].at, fmt::format("no sensor '{}'", name),
                       hint.empty() ? fmt::format("an output or an input, as in {}", kExample) : "",
                       hint);
    }
    root = with_sensor(std::move(root), name, sensors.items[i]);
  }
  return root;
}

}  // namespace identikal
