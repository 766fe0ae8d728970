#include "identify/model/internal/scale_form.h"

#include <algorithm>
#include <utility>

#include "identify/model/model_values.h"
#include "lib/data/units.h"

namespace identikal {
namespace {

template <typename Node>
Node* entry_of(Node& root, const char* first, const char* second) {
  Node* node = &root;
  for (const char* key : {first, second}) {
    const auto at = std::find_if(node->keys.begin(), node->keys.end(),
                                 [&](const YamlNode& k) { return k.text == key; });
    if (node->kind != YamlNode::Kind::mapping || at == node->keys.end()) return nullptr;
    node = &node->items[static_cast<std::size_t>(at - node->keys.begin())];
  }
  return node;
}

bool is_quantity(const std::string& text) {
  const auto quantity = split_quantity(text);
  return quantity && (quantity->unit.empty() || parse_unit(quantity->unit));
}

// Sets what the formula follows.
void look_at(const ModelFormulas& symbols, NoiseSpread& spread) {
  const int inputs = symbols.states, parameters = inputs + symbols.inputs;
  const int time = parameters + symbols.parameters;
  for (const Expression::Node& each : spread.formula.nodes) {
    if (each.op != Op::symbol) continue;
    if (each.symbol < inputs || each.symbol > time) spread.of_state = true;
    if ((each.symbol >= inputs && each.symbol < parameters) || each.symbol == time) {
      spread.of_inputs = true;
    }
  }
}

// Takes what `scalers` names out of a product.
void take_factors(const std::vector<std::string>& scalers, NoiseSpread& spread) {
  std::vector<Expression::Node>& nodes = spread.formula.nodes;
  const auto is_once = [&](int symbol) {
    return std::count_if(nodes.begin(), nodes.end(), [&](const Expression::Node& each) {
             return each.op == Op::symbol && each.symbol == symbol;
           }) == 1;
  };
  std::vector<int> open{static_cast<int>(nodes.size()) - 1};
  while (!open.empty()) {
    Expression::Node& node = nodes[static_cast<std::size_t>(open.back())];
    open.pop_back();
    if (node.op == Op::multiply) {
      open.insert(open.end(), {node.a, node.b});
    } else if (node.op == Op::symbol && is_once(node.symbol) &&
               !scalers[static_cast<std::size_t>(node.symbol)].empty()) {
      const std::string& name = scalers[static_cast<std::size_t>(node.symbol)];
      spread.factor = spread.factor == "1" ? name : spread.factor + "*" + name;
      node.op = Op::number;
      node.symbol = -1;
      node.value = 1.0;
    }
  }
}

Expression number(double value) {
  Expression out;
  out.nodes.emplace_back();
  out.nodes.back().value = value;
  return out;
}

Expression square_root(Expression of) {
  Expression::Node root;
  root.op = Op::sqrt;
  root.a = static_cast<int>(of.nodes.size()) - 1;
  of.nodes.push_back(root);
  return of;
}

}  // namespace

std::vector<NoiseSpread> moving_spreads(const YamlNode& root,
                                        const std::vector<std::string>& outputs,
                                        const ModelFormulas& symbols,
                                        const std::vector<std::string>& scalers,
                                        const ReadSpread& read) {
  std::vector<NoiseSpread> out;
  const YamlNode* measurement = entry_of(root, "noise", "measurement");
  if (measurement == nullptr || measurement->kind != YamlNode::Kind::mapping) return out;
  for (const bool variance : {false, true}) {
    const YamlNode* given = find(*measurement, variance ? "variance" : "sd");
    if (given == nullptr || given->kind != YamlNode::Kind::mapping) continue;
    for (std::size_t i = 0; i < outputs.size(); ++i) {
      const YamlNode* entry = find(*given, outputs[i]);
      if (entry == nullptr || entry->kind != YamlNode::Kind::scalar || is_quantity(entry->text)) {
        continue;
      }
      NoiseSpread spread{i, read(*entry, i, variance), variance, false, false, outputs[i]};
      look_at(symbols, spread);
      if (!spread.of_state && !spread.of_inputs) continue;
      take_factors(scalers, spread);
      out.push_back(std::move(spread));
    }
  }
  return out;
}

YamlNode with_factors_alone(YamlNode root, const std::vector<NoiseSpread>& spreads) {
  YamlNode* measurement = entry_of(root, "noise", "measurement");
  for (const NoiseSpread& spread : spreads) {
    YamlNode* entry =
        entry_of(*measurement, spread.variance ? "variance" : "sd", spread.key.c_str());
    entry->text = spread.factor;
  }
  return root;
}

NonlinearModel scales_of(const std::vector<NoiseSpread>& spreads, std::size_t outputs,
                         ModelFormulas symbols, const std::vector<bool>& known) {
  symbols.dynamics.assign(static_cast<std::size_t>(symbols.states),
                          number(0.0));  // which nothing takes
  symbols.outputs.assign(outputs, number(1.0));
  for (const NoiseSpread& spread : spreads) {
    symbols.outputs[spread.output] = spread.variance ? square_root(spread.formula) : spread.formula;
  }
  return make_nonlinear_model(symbols, Derivatives::first, known);
}

}  // namespace identikal
