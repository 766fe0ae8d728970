#include "identify/model/internal/reference_form.h"

#include <algorithm>

#include <fmt/format.h>

#include "identify/model/model_values.h"

namespace identikal {

StateReferences read_references(const YamlNode& root, const ModelFormulas& symbols,
                                const std::vector<std::string>& states,
                                const std::vector<bool>& known, const ReadReferenceFormula& read) {
  StateReferences out;
  const YamlNode* node = find(root, "reference");
  if (node == nullptr) return out;
  out.channels = read_channels(*node, "reference", {}, {"equals", "sd", "wrap"});
  ModelFormulas formulas = symbols;
  formulas.dynamics.clear();
  formulas.outputs.clear();
  for (const std::string& state : states) {
    formulas.dynamics.push_back(parse_expression(state, states));  // which nothing takes
  }
  for (std::size_t i = 0; i < out.channels.size(); ++i) {
    const YamlNode& item = node->items[i];
    const ChannelSource& channel = out.channels[i];
    const YamlNode* equals = find(item, "equals");
    if (equals == nullptr &&
        std::find(states.begin(), states.end(), channel.name) == states.end()) {
      throw InputError(item.at, fmt::format("reference '{}' is no state", channel.name),
                       "equals: formula of states");
    }
    const bool by_key = node->kind == YamlNode::Kind::mapping;
    const YamlNode& name = by_key ? node->keys[i] : *find(item, "name");
    formulas.outputs.push_back(read(equals != nullptr ? *equals : name, channel));
    const auto moves = [&](const Expression::Node& each) {
      const int first_definition = symbols.states + symbols.inputs + symbols.parameters + 1;
      return each.op == Op::symbol &&
             (each.symbol < symbols.states || each.symbol >= first_definition);
    };
    const std::vector<Expression::Node>& nodes = formulas.outputs.back().nodes;
    if (std::none_of(nodes.begin(), nodes.end(), moves)) {
      throw InputError(equals != nullptr ? equals->at : name.at,
                       fmt::format("reference '{}' depends on no state", channel.name),
                       "a formula of states");
    }
    const YamlNode* sd = find(item, "sd");
    out.sd.push_back(sd != nullptr ? read_si(*sd, channel.unit, "sd") : 0.0);
    if (sd != nullptr && !(out.sd.back() >= 0.0)) {
      throw InputError(sd->at, "sd is " + describe(*sd), "a standard deviation, 0 or above");
    }
  }
  out.quantities = make_nonlinear_model(formulas, Derivatives::second, known);
  return out;
}

}  // namespace identikal
