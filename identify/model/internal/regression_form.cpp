#include "identify/model/internal/regression_form.h"

#include <cmath>

#include <fmt/format.h>

#include "identify/model/model_values.h"

namespace identikal {
namespace {

constexpr double kMostSamples = 50.0;     // that a regression looks back
constexpr double kUsualMemory = 200.0;    // 1 / (1 - .995), the longest of the usual memories
constexpr double kShortestMemory = 10.0;  // less is noise

bool is_auto(const YamlNode& node) {
  return node.kind == YamlNode::Kind::scalar && node.text == "auto";
}

std::optional<Eigen::Index> read_order(const YamlNode& node, const char* key, double least) {
  if (is_auto(node)) return std::nullopt;
  const std::optional<double> number = plain_number(text_of(node, key));
  if (!number || *number < least || *number > kMostSamples || *number != std::floor(*number)) {
    throw InputError(node.at, fmt::format("{} is {}", key, describe(node)),
                     fmt::format("a whole number from {} to {}, or auto", least, kMostSamples));
  }
  return static_cast<Eigen::Index>(*number);
}

// The key `regression`, with orders and delta or without.
RegressionModel read_settings(const YamlNode& root, bool whole) {
  RegressionModel out;
  const YamlNode* node = find(root, "regression");
  if (node == nullptr) return out;
  std::vector<std::string> keys = {"forgetting", "memory", "reset"};
  if (whole) keys.insert(keys.end(), {"inputs", "feedback", "delta"});
  check_keys(*node, "regression", keys);
  if (const YamlNode* given = find(*node, "inputs")) out.inputs = read_order(*given, "inputs", 1.0);
  if (const YamlNode* given = find(*node, "feedback")) {
    out.feedback = read_order(*given, "feedback", 0.0);
  }
  if (const YamlNode* given = find(*node, "delta"); given != nullptr && !is_auto(*given)) {
    out.delta = read_plain_number(*given, "delta");
    if (!(*out.delta > 0.0)) {
      throw InputError(given->at, "delta is " + describe(*given), "a number above 0, or auto",
                       "P(0) = I / delta");
    }
  }
  bool variable = false;
  if (const YamlNode* given = find(*node, "forgetting"); given != nullptr && !is_auto(*given)) {
    variable = text_of(*given, "forgetting") == "variable";
    const std::optional<double> number = plain_number(given->text);
    if (!variable && !(number && *number > 0.0 && *number <= 1.0)) {
      throw InputError(given->at, "forgetting is " + describe(*given),
                       "above 0 and at most 1 (usual: 0.98 to 0.999), auto or variable");
    }
    if (!variable) out.forgetting = *number;
  }
  if (variable) out.memory = kUsualMemory;
  if (const YamlNode* given = find(*node, "memory")) {
    if (!variable) {
      throw InputError(given->at, "memory does not apply to a vehicle", "",
                       "it goes with forgetting: variable");
    }
    out.memory = read_plain_number(*given, "memory");
    if (!(out.memory >= kShortestMemory)) {
      throw InputError(given->at, "memory is " + describe(*given),
                       fmt::format("{} samples or more", kShortestMemory));
    }
  }
  if (const YamlNode* given = find(*node, "reset")) {
    out.reset = word_of(*given, "reset", {"true", "false"}) == "true";
  }
  return out;
}

}  // namespace

RegressionModel read_tracking(const YamlNode& root) { return read_settings(root, false); }

void read_regression(const YamlNode& root, Model& out) {
  const std::string top = "the model file";
  out.inputs = read_channels(
      required(root, "inputs", top, "inputs: {steer: {column: swa, unit: deg}}"), "inputs", {});
  const YamlNode& outputs =
      required(root, "outputs", top, "outputs: {r: {column: yaw_rate, unit: deg/s}}");
  out.outputs = read_channels(outputs, "outputs", {});
  if (out.outputs.size() != 1) {
    throw InputError(outputs.at, fmt::format("a regression of {} outputs", out.outputs.size()),
                     "one", "make a model file for each output");
  }
  for (const ChannelSource& input : out.inputs) {
    if (input.name != out.outputs[0].name) continue;
    throw InputError(outputs.at, fmt::format("{} is an input and the output", input.name),
                     "names of their own");
  }
  out.form = read_settings(root, true);
}

}  // namespace identikal
