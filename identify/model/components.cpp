#include "identify/model/components.h"

#include <algorithm>
#include <cctype>
#include <set>
#include <utility>

#include <fmt/format.h>

#include "identify/model/included_files.h"
#include "identify/model/internal/component_kinds.h"
#include "identify/model/internal/yaml_tree.h"
#include "identify/model/matrix_reader.h"
#include "identify/model/model_values.h"

namespace identikal {
namespace {

using Node = YamlNode;

// Is it a word of the formula?
bool names(const std::string& formula, const std::string& word) {
  const auto in_word = [](char c) {
    return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_';
  };
  for (std::size_t at = formula.find(word); at != std::string::npos;
       at = formula.find(word, at + 1)) {
    const std::size_t end = at + word.size();
    if ((at == 0 || !in_word(formula[at - 1])) && (end == formula.size() || !in_word(formula[end])))
      return true;
  }
  return false;
}

// Outputs as a list, as matrices have them, by their names.
Node by_name(Node outputs) {
  Node named = yaml_mapping();
  named.at = outputs.at;
  for (Node& each : outputs.items) {
    const Node* name = each.kind == Node::Kind::mapping ? find(each, "name") : nullptr;
    if (name == nullptr) {
      throw InputError(each.at, "an output without a name", "{name: y, column: y}");
    }
    Node body = yaml_mapping();
    body.at = each.at;
    for (std::size_t i = 0; i < each.keys.size(); ++i) {
      if (each.keys[i].text == "name") continue;
      body.keys.push_back(each.keys[i]);
      body.items.push_back(each.items[i]);
    }
    named.keys.push_back(*name);
    named.items.push_back(std::move(body));
  }
  return named;
}

// Builds the written-out model.
class Writer {
 public:
  explicit Writer(Node root) : root_(std::move(root)) {}

  Node write() {
    const Node components = *find(root_, "components");
    check_mapping(components, "components");
    const Node* time = find(root_, "time");
    const Node* kind = time == nullptr ? nullptr : find(*time, "kind");
    continuous_ = kind != nullptr && kind->text == "continuous";
    if (kind == nullptr && time != nullptr) {
      Node& own = value_at(root_, "time");
      append(own, "kind", yaml_scalar("discrete"));
    }
    for (std::size_t i = 0; i < components.keys.size(); ++i) {
      check_name(components.keys[i], "a component");
      const std::string& name = components.keys[i].text;
      given_.push_back(
          {name, &components.items[i], component_of(name, components.items[i], continuous_)});
    }
    erase("components");
    write_known();
    write_outputs();
    write_states();
    write_noise();
    write_measurement();
    write_start();
    return std::move(root_);
  }

 private:
  struct Entry {
    std::string name;
    const Node* node;
    Component component;
  };

  void erase(const std::string& key) {
    for (std::size_t i = 0; i < root_.keys.size(); ++i) {
      if (root_.keys[i].text != key) continue;
      root_.keys.erase(root_.keys.begin() + static_cast<std::ptrdiff_t>(i));
      root_.items.erase(root_.items.begin() + static_cast<std::ptrdiff_t>(i));
      return;
    }
  }

  // Does a component go into this output, where its formula is left out?
  bool goes_into(const Entry& entry, const std::string& output, std::size_t outputs) const {
    const Node* to =
        entry.node->kind == Node::Kind::mapping ? find(*entry.node, "output") : nullptr;
    if (to == nullptr) return outputs == 1;
    if (to->kind != Node::Kind::list) return to->text == output;
    return std::any_of(to->items.begin(), to->items.end(),
                       [&](const Node& each) { return each.text == output; });
  }

  // A parameter that the file has itself keeps what the file says of it.
  void write_known() {
    for (const Entry& entry : given_) {
      for (const Component::Known& known : entry.component.known) {
        Node& parameters = value_at(root_, "parameters");
        if (find(parameters, known.name) == nullptr) append(parameters, known.name, known.value);
      }
    }
  }

  void write_outputs() {
    Node& outputs = value_at(root_, "outputs");
    if (outputs.kind == Node::Kind::list) outputs = by_name(std::move(outputs));
    std::string all;
    for (std::size_t i = 0; i < outputs.keys.size(); ++i) {
      Node& output = outputs.items[i];
      if (output.kind != Node::Kind::mapping) continue;  // is refused where outputs are read
      if (const Node* equals = find(output, "equals")) {
        all += " " + equals->text;
        continue;
      }
      output.keys.push_back(yaml_scalar("equals"));
      output.items.push_back(sum_in(outputs.keys[i].text, outputs.keys.size(), output));
    }
    write_names(all);
  }

  // What an output sees whose formula is left out.
  Node sum_in(const std::string& output, std::size_t outputs, const Node& at) const {
    std::string sum;
    for (const Entry& entry : given_) {
      if (!goes_into(entry, output, outputs)) continue;
      sum += (sum.empty() ? "" : " + ") + entry.component.visible;
    }
    if (!sum.empty()) return yaml_scalar(sum, at);
    throw InputError(at.at, fmt::format("no component goes into output '{}'", output),
                     "output: NAME of a component, or equals: formula of components");
  }

  // Formulas know a component by its name, also where no state has it.
  void write_names(const std::string& formulas) {
    for (const Entry& entry : given_) {
      const auto& states = entry.component.states;
      const bool is_state = std::any_of(states.begin(), states.end(),
                                        [&](const auto& s) { return s.name == entry.name; });
      if (is_state || !names(formulas, entry.name)) continue;
      append(value_at(root_, "let"), entry.name, yaml_scalar(entry.component.visible, *entry.node));
    }
  }

  void write_states() {
    const bool with_units = std::any_of(given_.begin(), given_.end(), [](const Entry& entry) {
      return entry.node->kind == Node::Kind::mapping && find(*entry.node, "unit") != nullptr;
    });
    const bool are_there = find(root_, "states") != nullptr;
    value_at(root_, "states");  // both are made before either is referred to
    value_at(root_, "dynamics");
    Node& states = value_at(root_, "states");
    if (!are_there && !with_units) states.kind = Node::Kind::list;
    Node& dynamics = value_at(root_, "dynamics");
    std::set<std::string> taken;
    for (const Node& key : dynamics.keys) taken.insert(key.text);
    for (const Entry& entry : given_) {
      for (const Component::State& state : entry.component.states) {
        if (!taken.insert(state.name).second) {
          throw InputError(entry.node->at,
                           fmt::format("component '{}' has a state '{}', and there is "
                                       "one already",
                                       entry.name, state.name),
                           "another name");
        }
        Node name = yaml_scalar(state.name, *entry.node);
        if (states.kind == Node::Kind::list) {
          states.items.push_back(name);
        } else {
          states.keys.push_back(name);
          states.items.push_back(yaml_scalar(state.unit.empty() ? "1" : state.unit, *entry.node));
        }
        dynamics.keys.push_back(name);
        dynamics.items.push_back(yaml_scalar(state.dynamics, *entry.node));
      }
    }
  }

  void write_noise() {
    Node& process = value_at(value_at(root_, "noise"), "process");
    if (process.kind != Node::Kind::mapping) {
      throw InputError(process.at, "process is " + describe(process),
                       "{variance: {STATE: NUMBER}} beside components");
    }
    if (const Node* sd = find(process, "sd")) {
      throw InputError(sd->at, "process noise by 'sd' beside components", "variance: {STATE: ...}");
    }
    if (find(process, "kind") == nullptr) {
      append(process, "kind", yaml_scalar(continuous_ ? "density" : "per-sample"));
    }
    Node& variance = value_at(process, "variance");
    for (const Entry& entry : given_) {
      for (const Component::Noise& noise : entry.component.noise) {
        variance.keys.push_back(yaml_scalar(noise.state, *entry.node));
        variance.items.push_back(noise.variance);
      }
    }
  }

  // An autoregressive moving average is seen as it is, unless the file says otherwise.
  void write_measurement() {
    const bool any_arma = std::any_of(given_.begin(), given_.end(), [](const Entry& entry) {
      const Node* kind =
          entry.node->kind == Node::Kind::mapping ? find(*entry.node, "kind") : nullptr;
      return kind != nullptr && kind->text == "arma";
    });
    Node& noise = value_at(root_, "noise");
    if (!any_arma || find(noise, "measurement") != nullptr || find(root_, "R") != nullptr) return;
    Node none = yaml_mapping();
    for (const Node& output : value_at(root_, "outputs").keys) {
      append(none, output.text, yaml_scalar("0"));
    }
    append(value_at(noise, "measurement"), "variance", std::move(none));
  }

  // States that the file adds by itself start diffuse.
  void write_start() {
    if (find(root_, "initial") != nullptr) return;
    Node diffuse = yaml_list();
    bool any_stationary = false;
    std::set<std::string> stationary;
    for (const Entry& entry : given_) {
      const std::vector<std::string>& of = entry.component.stationary_states;
      stationary.insert(of.begin(), of.end());
    }
    for (const Node& key : find(root_, "dynamics")->keys) {
      if (stationary.count(key.text) == 0) {
        diffuse.items.push_back(yaml_scalar(key.text));
      } else {
        any_stationary = true;
      }
    }
    if (!any_stationary) {
      append(root_, "initial", yaml_scalar("diffuse"));
    } else if (diffuse.items.empty()) {
      append(root_, "initial", yaml_scalar("stationary"));
    } else {
      Node initial = yaml_mapping();
      append(initial, "diffuse", std::move(diffuse));
      append(root_, "initial", std::move(initial));
    }
  }

  Node root_;
  bool continuous_ = false;
  std::vector<Entry> given_;
};

}  // namespace

YamlNode with_components(YamlNode root) {
  if (find(root, "components") == nullptr) return root;
  return Writer(std::move(root)).write();
}

std::string written_out(const std::string& text, const std::string& path) {
  return yaml_text(with_components(parse_with_included(text, path)));
}

}  // namespace identikal
