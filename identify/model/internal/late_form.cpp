#include "identify/model/internal/late_form.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "identify/model/model_values.h"
#include "lib/base/nearest_name.h"
#include "lib/data/units.h"
#include "lib/formula/dimension.h"

namespace identikal {
namespace {

void check_delay(const YamlNode& node, const Parameter& delay) {
  const Dimension time = dimension_of(*parse_unit("s"));
  const Dimension given = dimension_of(unit_or_dimensionless(delay.unit));
  if (!delay.unit.empty() && given.exponent != time.exponent) {
    throw InputError(node.at,
                     fmt::format("the delay {} is {}", in_quotes(delay.name), in_words(given)),
                     "a time");
  }
  if (delay.fixed || (std::isfinite(delay.min) && std::isfinite(delay.max))) return;
  throw InputError(
      node.at, fmt::format("the delay {} may be anything", in_quotes(delay.name)),
      "min and max of that parameter: rows in which some delay between reaches beyond the "
      "recording are not used");
}

}  // namespace

std::optional<int> take_unknown_delay(YamlNode& input, NamedParameters& parameters) {
  const auto key = std::find_if(input.keys.begin(), input.keys.end(),
                                [](const YamlNode& each) { return each.text == "delay"; });
  if (key == input.keys.end()) return std::nullopt;
  const auto at = key - input.keys.begin();
  const YamlNode node = input.items[static_cast<std::size_t>(at)];
  const bool is_number = node.kind != YamlNode::Kind::scalar || split_quantity(trimmed(node.text));
  if (is_number) return std::nullopt;
  const auto known = std::find(parameters.names.begin(), parameters.names.end(), node.text);
  if (known == parameters.names.end()) {
    throw InputError(node.at, "delay is " + describe(node),
                     "a time such as 0.1 s, or the name of a parameter",
                     did_you_mean(node.text, parameters.names));
  }
  const auto index = static_cast<std::size_t>(known - parameters.names.begin());
  check_delay(node, parameters.set[index]);
  parameters.used[index] = true;
  input.keys.erase(input.keys.begin() + at);
  input.items.erase(input.items.begin() + at);
  return static_cast<int>(index);
}

void refuse_beside_late_inputs(const YamlNode& root, InputPath path, bool starts_at_rest) {
  const auto refuse = [](const YamlNode* node, const char* what) {
    if (node == nullptr) return;
    throw InputError(node->at, fmt::format("{} beside an input with an unknown delay", what),
                     "delay: a time that is known");
  };
  refuse(find(root, "reference"), "a reference");
  refuse(find(root, "doses"), "doses");
  if (starts_at_rest) refuse(find(root, "initial"), "a start in a steady state");
  if (path == InputPath::pchip) refuse(find(*find(root, "time"), "inputs"), "inputs: pchip");
}

}  // namespace identikal
