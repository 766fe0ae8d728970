#include "identify/model/internal/condition_form.h"

#include <algorithm>
#include <span>
#include <utility>

#include <fmt/format.h>

#include "identify/model/matrix_reader.h"
#include "identify/model/model_values.h"
#include "identify/model/output_conditions.h"
#include "lib/data/units.h"
#include "lib/formula/dimension.h"

namespace identikal {
namespace {

void read_flags_of_outputs(const YamlNode& root, Model& out) {
  const YamlNode* node = find(root, "flags");
  if (node == nullptr) return;
  out.flags = read_channels(*node, "flags", {});
  for (const ChannelSource& flag : out.flags) {
    const auto same = [&](const ChannelSource& other) { return other.name == flag.name; };
    if (std::any_of(out.inputs.begin(), out.inputs.end(), same) ||
        std::any_of(out.outputs.begin(), out.outputs.end(), same)) {
      throw InputError(flag.at, "flag " + in_quotes(flag.name) + " is a channel already",
                       "another name");
    }
  }
}

// A channel without a unit stands for any quantity, in SI.
std::vector<Dimension> condition_dimensions(const Model& model) {
  std::vector<Dimension> out;
  const auto add = [&](const ChannelSource& channel) {
    out.push_back(dimension_of(unit_or_dimensionless(channel.unit)));
    out.back().plain = channel.unit.empty();
  };
  for (const ChannelSource& input : model.inputs) add(input);
  for (const ChannelSource& output : model.outputs) add(output);
  for (const ChannelSource& flag : model.flags) add(flag);
  out.push_back(dimension_of(Unit{1.0, 0.0, {0, 0, 1, 0, 0}}));
  return out;
}

OutputCondition read_condition(const YamlNode& node, Eigen::Index output, const Model& model) {
  const std::vector<std::string> names = condition_symbols(model);
  NamedParameters none;
  const auto first = static_cast<int>(names.size());
  const std::string what =
      fmt::format("when of '{}'", model.outputs[static_cast<std::size_t>(output)].name);
  OutputCondition out{output, read_formula(node, what, names, first, none, FormulaKind::condition),
                      text_of(node, what)};
  for (const Expression::Node& each : out.holds.nodes) {
    if (each.op != Op::symbol) continue;
    const auto k = static_cast<Eigen::Index>(each.symbol - static_cast<int>(model.inputs.size()));
    const bool is_output = k >= 0 && k < static_cast<Eigen::Index>(model.outputs.size());
    if (!is_output || !model.outputs[static_cast<std::size_t>(k)].value) continue;
    throw InputError(place_in(node, each.column),
                     in_quotes(names[static_cast<std::size_t>(each.symbol)]) +
                         " is a pseudo-measurement, which says nothing of a row",
                     "inputs, measured outputs, flags, and the time t");
  }
  try {
    dimension_of(out.holds, condition_dimensions(model));
  } catch (const FormulaError& error) {
    throw error.in_file(place_in(node, error.column()));
  }
  return out;
}

void refuse_unused_flags(const Model& model) {
  const std::size_t first = model.inputs.size() + model.outputs.size();
  for (std::size_t i = 0; i < model.flags.size(); ++i) {
    const auto asks = [&](const OutputCondition& condition) {
      return std::any_of(condition.holds.nodes.begin(), condition.holds.nodes.end(),
                         [&](const Expression::Node& node) {
                           return node.op == Op::symbol &&
                                  node.symbol == static_cast<int>(first + i);
                         });
    };
    if (std::any_of(model.conditions.begin(), model.conditions.end(), asks)) continue;
    throw InputError(model.flags[i].at,
                     fmt::format("no output asks the flag {}", in_quotes(model.flags[i].name)),
                     fmt::format("when: \"{} > 0\" at an output, or no flag", model.flags[i].name));
  }
}

}  // namespace

void read_conditions(const YamlNode& root, Model& out) {
  read_flags_of_outputs(root, out);
  const YamlNode* outputs = find(root, "outputs");
  for (std::size_t i = 0; outputs != nullptr && i < outputs->items.size(); ++i) {
    const YamlNode* when = find(outputs->items[i], "when");
    if (when == nullptr) continue;
    out.conditions.push_back(read_condition(*when, static_cast<Eigen::Index>(i), out));
  }
  refuse_unused_flags(out);
}

}  // namespace identikal
