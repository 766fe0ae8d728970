#include "identify/model/extension.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <optional>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "identify/model/internal/yaml_tree.h"
#include "identify/model/matrix_reader.h"
#include "lib/data/units.h"

namespace identikal {
namespace {

using Kind = YamlNode::Kind;

constexpr double kStartSteps = 30.0, kLeastSteps = 2.0, kMostSteps = 1e5;  // of tau

const YamlNode& formulas_part(const YamlNode& model, const char* key) {
  const YamlNode* part = find(model, key);
  if (part == nullptr || part->kind != Kind::mapping) {
    throw InputError(model.at, fmt::format("the model has no '{}' by names", key),
                     "a model of formulas: states, dynamics, outputs, noise by their names");
  }
  return *part;
}

YamlNode& named_part(YamlNode& parent, const std::string& key, const char* where) {
  if (find(parent, key) == nullptr) {
    throw InputError(parent.at, fmt::format("no {} '{}'", where, key));
  }
  return value_at(parent, key);
}

const YamlNode* input_of(const YamlNode& model, const std::string& name) {
  const YamlNode* inputs = find(model, "inputs");
  return inputs != nullptr && inputs->kind == Kind::mapping ? find(*inputs, name) : nullptr;
}

// The unit of an output or an input as its model file has it, or of a state.
std::string unit_of(const YamlNode& model, const std::string& name) {
  const YamlNode* channel = find(formulas_part(model, "outputs"), name);
  if (channel == nullptr) channel = input_of(model, name);
  if (channel != nullptr) {
    const YamlNode* unit = find(*channel, "unit");
    return unit != nullptr ? unit->text : "";
  }
  const YamlNode* states = find(model, "states");
  const YamlNode* unit = states != nullptr ? find(*states, name) : nullptr;
  return unit != nullptr ? unit->text : "";
}

// The name, or one like it that nothing has.
std::string unused(const YamlNode& model, std::string name) {
  const auto taken = [&](const std::string& text) {
    for (const char* key : {"parameters", "inputs", "let"}) {
      const YamlNode* part = find(model, key);
      if (part != nullptr && part->kind == Kind::mapping && find(*part, text) != nullptr)
        return true;
    }
    return find(formulas_part(model, "dynamics"), text) != nullptr;
  };
  while (taken(name)) name += "_";
  return name;
}

void add_parameter(YamlNode& model, const std::string& name, double value, const std::string& unit,
                   std::optional<double> least, std::optional<double> most = std::nullopt) {
  YamlNode node = yaml_mapping();
  const auto quantity = [&unit](double number) {
    return yaml_scalar(fmt::format("{:.9g}{}{}", number, unit.empty() ? "" : " ", unit));
  };
  append(node, "value", quantity(value));
  if (least) append(node, "min", quantity(*least));
  if (most) append(node, "max", quantity(*most));
  append(value_at(model, "parameters"), name, std::move(node));
}

// The formula of an output; one without is the state of its name.
std::string formula_of(const YamlNode& model, const std::string& output) {
  const YamlNode* node = find(formulas_part(model, "outputs"), output);
  const YamlNode* equals = node != nullptr ? find(*node, "equals") : nullptr;
  return equals != nullptr ? equals->text : output;
}

void write_output(YamlNode& model, const std::string& output, const std::string& formula) {
  YamlNode& node = named_part(value_at(model, "outputs"), output, "output");
  const YamlNode* before = find(node, "equals");
  YamlNode written = yaml_scalar(formula, before != nullptr ? *before : node);
  value_at(node, "equals") = std::move(written);
}

// Every name in a formula, as `with` has it.
template <typename With>
std::string with_names(const std::string& formula, const With& with) {
  const auto begins = [](char c) { return is_name({&c, 1}); };
  const auto goes_on = [&](char c) {
    return begins(c) || std::isdigit(static_cast<unsigned char>(c)) || c == '.';
  };
  std::string out;
  for (std::size_t i = 0; i < formula.size();) {
    std::size_t end = i + 1;
    while (goes_on(formula[i]) && end < formula.size() && goes_on(formula[end])) ++end;
    const std::string part = formula.substr(i, end - i);
    out += begins(formula[i]) ? with(part) : part;
    i = end;
  }
  return out;
}

// Of a curve or a table: in what it is over.
void write_name(YamlNode& formula, const std::string& name, const std::string& by) {
  if (formula.kind == Kind::scalar) {
    const auto with = [&](const std::string& part) { return part == name ? by : part; };
    formula = yaml_scalar(with_names(formula.text, with), formula);
  }
  for (std::size_t i = 0; i < formula.items.size(); ++i) {
    const bool over = formula.kind == Kind::list || formula.keys[i].text == "spline" ||
                      formula.keys[i].text == "table";
    if (over) write_name(formula.items[i], name, by);
  }
}

// In every formula of the motion and of what is measured.
void write_input(YamlNode& model, const std::string& input, const std::string& formula) {
  for (const char* key : {"dynamics", "let"}) {
    if (find(model, key) == nullptr) continue;
    for (YamlNode& each : value_at(model, key).items) write_name(each, input, formula);
  }
  for (YamlNode& each : value_at(model, "outputs").items) {
    if (find(each, "equals") != nullptr) write_name(value_at(each, "equals"), input, formula);
  }
}

// What is measured, with its error: of an input what acts is the measurement without it.
void add_error(YamlNode& model, const std::string& channel, const std::string& error) {
  if (find(formulas_part(model, "outputs"), channel) == nullptr) {
    return write_input(model, channel, "(" + channel + " - " + error + ")");
  }
  const std::string before = formula_of(model, channel);
  write_output(model, channel, (before == channel ? before : "(" + before + ")") + " + " + error);
}

void add_state(YamlNode& model, const std::string& name, const std::string& unit,
               const std::string& dynamics, const std::string& sd) {
  YamlNode& states = value_at(model, "states");
  if (states.kind == Kind::list) {
    states.items.push_back(yaml_scalar(name));
  } else {
    append(states, name, yaml_scalar(unit.empty() ? "1" : unit));
  }
  append(value_at(model, "dynamics"), name, yaml_scalar(dynamics));
  YamlNode& initial = value_at(model, "initial");
  if (initial.kind == Kind::scalar && initial.text == "diffuse") {  // the others alone
    YamlNode others = yaml_list();
    for (const YamlNode& each : states.kind == Kind::list ? states.items : states.keys) {
      if (each.text != name) others.items.push_back(yaml_scalar(each.text));
    }
    initial = yaml_mapping();
    append(initial, "diffuse", std::move(others));
  }
  if (initial.kind != Kind::mapping || find(initial, "mean") == nullptr) return;
  append(value_at(initial, "mean"), name, yaml_scalar("0"));
  append(value_at(initial, "sd"), name, yaml_scalar(sd));
}

// Beside the process noise that is there.
void add_process_variance(YamlNode& model, const std::string& state, const std::string& formula) {
  YamlNode& process = value_at(value_at(model, "noise"), "process");
  const bool as_sd = find(process, "sd") != nullptr;
  append(value_at(process, as_sd ? "sd" : "variance"), state,
         yaml_scalar(as_sd ? "sqrt(" + formula + ")" : formula));
}

// Parameters of lasting errors.
struct LastingNames {
  std::string sd, tau, step;  // step: of discrete time, known
};

LastingNames add_lasting_parameters(YamlNode& model, const std::string& of, const std::string& unit,
                                    double size, double step) {
  const LastingNames out{unused(model, "sd_" + of), unused(model, "tau_" + of),
                         unused(model, "step_" + of)};
  const YamlNode* states = find(model, "states");
  const bool with_units = states != nullptr && states->kind == Kind::mapping;
  add_parameter(model, out.sd, size / unit_or_dimensionless(unit).scale, unit, 0.0);
  add_parameter(model, out.tau, kStartSteps * step, with_units ? "s" : "", kLeastSteps * step,
                kMostSteps * step);
  if (!has_continuous_time(model)) {
    append(value_at(model, "parameters"), out.step,
           yaml_scalar(fmt::format("{:.12g}{}", step, with_units ? " s" : "")));
  }
  return out;
}

// x' = -x/tau + w.
void add_lasting_state(YamlNode& model, const std::string& own, const std::string& unit,
                       const LastingNames& by) {
  if (has_continuous_time(model)) {
    add_state(model, own, unit, fmt::format("-{}/{}", own, by.tau), by.sd);
    add_process_variance(model, own, fmt::format("2*{}^2/{}", by.sd, by.tau));
  } else {
    add_state(model, own, unit, fmt::format("{}*exp(-{}/{})", own, by.step, by.tau), by.sd);
    add_process_variance(model, own,
                         fmt::format("{}^2*(1 - exp(-2*{}/{}))", by.sd, by.step, by.tau));
  }
}

void add_lasting_errors(YamlNode& model, const ModelExtension& extension, double step) {
  std::optional<LastingNames> of_all;
  for (std::size_t i = 0; i < extension.names.size(); ++i) {
    const std::string& name = extension.names[i];
    if (!of_all || !extension.alike) {
      of_all = add_lasting_parameters(model, extension.alike ? "errors" : name,
                                      unit_of(model, name), extension.size[i], step);
    }
    const std::string own = unused(model, "error_" + name);
    add_lasting_state(model, own, unit_of(model, name), *of_all);
    add_error(model, name, own);
  }
}

void add_coloured_process_noise(YamlNode& model, const ModelExtension& extension, double step) {
  std::optional<LastingNames> of_all;
  for (std::size_t i = 0; i < extension.names.size(); ++i) {
    const std::string& name = extension.names[i];
    const std::string of_state = unit_of(model, name);
    const std::string unit =
        has_continuous_time(model) ? (of_state.empty() ? "" : of_state + "/s") : of_state;
    if (!of_all || !extension.alike) {
      of_all =
          add_lasting_parameters(model, extension.alike ? "disturbances" : "disturbance_" + name,
                                 unit, extension.size[i], step);
    }
    const std::string own = unused(model, "disturbance_" + name);
    add_lasting_state(model, own, unit, *of_all);
    YamlNode& dynamics = named_part(value_at(model, "dynamics"), name, "dynamics of");
    dynamics =
        yaml_scalar(dynamics.text == "0" ? own : "(" + dynamics.text + ") + " + own, dynamics);
  }
}

// As the names of parameters have two outputs.
std::string joined(const ModelExtension& two) { return two.names[0] + "_" + two.names[1]; }

void add_opposite_scales(YamlNode& model, const ModelExtension& two) {
  const std::string name = unused(model, "scale_" + joined(two));
  add_parameter(model, name, 1.0, "", std::nullopt);
  write_output(model, two.names[0], name + "*(" + formula_of(model, two.names[0]) + ")");
  write_output(model, two.names[1], "(" + formula_of(model, two.names[1]) + ")/" + name);
}

void add_opposite_biases(YamlNode& model, const ModelExtension& two) {
  const std::string name = unused(model, "bias_" + joined(two));
  add_parameter(model, name, 0.0, unit_of(model, two.names[0]), std::nullopt);
  write_output(model, two.names[0], "(" + formula_of(model, two.names[0]) + ") + " + name);
  write_output(model, two.names[1], "(" + formula_of(model, two.names[1]) + ") - " + name);
}

void add_scale(YamlNode& model, const std::string& channel) {
  const std::string name = unused(model, "scale_" + channel);
  add_parameter(model, name, 1.0, "", std::nullopt);
  if (find(formulas_part(model, "outputs"), channel) == nullptr) {
    write_input(model, channel, "(" + channel + "/" + name + ")");
  } else {
    write_output(model, channel, name + "*(" + formula_of(model, channel) + ")");
  }
}

// x(t - d) = x(t) - d x'(t), to first order.
void add_delay(YamlNode& model, const std::string& output) {
  if (!can_be_late(model, output)) {
    throw InputError(
        model.at, fmt::format("'{}' with a delay", output),
        "continuous time, and an output that is written in states that move and parameters");
  }
  const std::string name = unused(model, "delay_" + output);
  const YamlNode* states = find(model, "states");
  const bool with_units = states != nullptr && states->kind == Kind::mapping;
  add_parameter(model, name, 0.0, with_units ? "s" : "", std::nullopt);
  const YamlNode& dynamics = formulas_part(model, "dynamics");
  const std::string late = with_names(formula_of(model, output), [&](const std::string& part) {
    const YamlNode* slope = find(dynamics, part);
    if (slope == nullptr || slope->text == "0") return part;
    return fmt::format("({} - {}*({}))", part, name, slope->text);
  });
  write_output(model, output, late);
}

void add_bias(YamlNode& model, const std::string& channel) {
  const std::string name = unused(model, "bias_" + channel);
  add_parameter(model, name, 0.0, unit_of(model, channel), std::nullopt);
  add_error(model, channel, name);
}

// The dynamics of a state, less a term.
void subtract(YamlNode& model, const std::string& state, const std::string& term) {
  YamlNode& dynamics = named_part(value_at(model, "dynamics"), state, "dynamics of");
  dynamics = yaml_scalar(dynamics.text == "0" ? "-" + term : "(" + dynamics.text + ") - " + term,
                         dynamics);
}

void add_quadratic_damping(YamlNode& model, const std::string& state) {
  const std::string name = unused(model, "drag_" + state), unit = unit_of(model, state);
  const char* per = has_continuous_time(model) ? " s" : "";
  add_parameter(model, name, 0.0, unit.empty() ? "" : "1/((" + unit + ")" + per + ")",
                std::nullopt);
  subtract(model, state, fmt::format("{0}*{1}*abs({1})", name, state));
}

void add_dry_friction(YamlNode& model, const std::string& state, double size) {
  constexpr double kSlow = 0.1;
  const std::string name = unused(model, "friction_" + state),
                    slow = unused(model, "slow_" + state), unit = unit_of(model, state);
  const char* per = has_continuous_time(model) ? "/s" : "";
  add_parameter(model, name, 0.0, unit.empty() ? "" : unit + per, std::nullopt);
  append(value_at(model, "parameters"), slow,
         yaml_scalar(fmt::format("{:.3g}{}{}", kSlow * size / unit_or_dimensionless(unit).scale,
                                 unit.empty() ? "" : " ", unit)));
  subtract(model, state, fmt::format("{}*tanh({}/{})", name, state, slow));
}

void add_cubic_stiffness(YamlNode& model, const std::string& state, const std::string& by) {
  const std::string name = unused(model, "cubic_" + state + "_" + by), unit = unit_of(model, state),
                    of_other = unit_of(model, by);
  const bool with_units = !unit.empty() && !of_other.empty();
  const char* per = has_continuous_time(model) ? "/s" : "";
  add_parameter(model, name, 0.0, with_units ? unit + per + "/(" + of_other + ")^3" : "",
                std::nullopt);
  subtract(model, state, fmt::format("{}*{}^3", name, by));
}

void add_curved_input(YamlNode& model, const std::string& input) {
  const std::string name = unused(model, "curve_" + input), unit = unit_of(model, input);
  add_parameter(model, name, 0.0, unit.empty() ? "" : "1/(" + unit + ")", std::nullopt);
  write_input(model, input, fmt::format("({1} + {0}*{1}*abs({1}))", name, input));
}

// The variances of these names times a ratio, from a time on.
// @param of     "measurement" or "process"
// @param about  what its parameters are named by
// @param from   minus infinity: always
void change_noise(YamlNode& model, const char* of, const std::vector<std::string>& names,
                  const std::string& about, double ratio, double from) {
  const YamlNode* states = find(model, "states");
  const bool with_units = states != nullptr && states->kind == Kind::mapping;
  const std::string change = unused(model, "change_" + about),
                    factor = unused(model, "ratio_" + about);
  const bool always = std::isinf(from);
  if (!always) {
    append(value_at(model, "parameters"), change,
           yaml_scalar(fmt::format("{:.12g}{}", from, with_units ? " s" : "")));
  }
  add_parameter(model, factor, ratio, "", 0.0);
  YamlNode& noise = named_part(value_at(model, "noise"), of, "noise");
  const bool as_sd = find(noise, "sd") != nullptr;
  YamlNode& sizes = named_part(noise, as_sd ? "sd" : "variance", "noise by names, its");
  const std::string times = always ? factor : fmt::format("if(t < {}, 1, {})", change, factor);
  for (const std::string& name : names) {
    YamlNode& size = named_part(sizes, name, "noise of");
    size =
        yaml_scalar(fmt::format("({})*{}", size.text, as_sd ? "sqrt(" + times + ")" : times), size);
  }
}

// States, or outputs, whose noise has a size of its own.
std::vector<std::string> names_with_noise(const YamlNode& model, const char* of) {
  std::vector<std::string> out;
  const YamlNode* noise = find(formulas_part(model, "noise"), of);
  for (const char* key : {"variance", "sd"}) {
    const YamlNode* sizes = noise != nullptr ? find(*noise, key) : nullptr;
    if (sizes == nullptr || sizes->kind != Kind::mapping) continue;
    for (const YamlNode& name : sizes->keys) out.push_back(name.text);
  }
  return out;
}

// Of "measurement" or "process" noise: the names whose size is written with the same letters.
std::vector<std::vector<std::string>> alike(const YamlNode& model, const char* of) {
  const YamlNode* noise = find(formulas_part(model, "noise"), of);
  const YamlNode* written = nullptr;
  for (const char* key : {"variance", "sd"}) {
    if (noise != nullptr && written == nullptr) written = find(*noise, key);
  }
  std::vector<std::vector<std::string>> out;
  if (written == nullptr || written->kind != Kind::mapping) return out;
  std::vector<std::string> sizes;
  for (std::size_t i = 0; i < written->keys.size(); ++i) {
    const std::string& text = written->items[i].text;
    if (text.find_first_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ") ==
        std::string::npos) {
      continue;
    }
    const auto at = std::find(sizes.begin(), sizes.end(), text);
    if (at == sizes.end()) {
      sizes.push_back(text);
      out.push_back({written->keys[i].text});
    } else {
      out[static_cast<std::size_t>(at - sizes.begin())].push_back(written->keys[i].text);
    }
  }
  return out;
}

// Of two outputs in opposite directions.
bool is_opposite(const ModelExtension& extension) {
  return extension.alike && is_constant(extension.kind) && extension.names.size() == 2;
}

}  // namespace

std::string in_words(const ModelExtension& extension) {
  const std::string names = fmt::format("{}", fmt::join(extension.names, ", "));
  const bool several = extension.names.size() > 1;
  if (is_opposite(extension)) {
    return fmt::format("a {} between {} and {}, half of it in each",
                       extension.kind == ExtensionKind::bias ? "difference" : "ratio",
                       extension.names[0], extension.names[1]);
  }
  switch (extension.kind) {
    case ExtensionKind::bias:
      return (several ? "biases of " : "a bias of ") + names;
    case ExtensionKind::lasting_error:
      return (several ? "errors that last, " : "an error that lasts, ") +
             std::string(extension.alike ? "alike, of " : "of ") + names;
    case ExtensionKind::scale:
      return (several ? "scales of " : "a scale of ") + names;
    case ExtensionKind::delay:
      return "a delay of " + names;
    case ExtensionKind::coloured_process_noise:
      return "coloured process noise of " + names + (extension.alike ? ", alike" : "");
    case ExtensionKind::measurement_noise_change:
      if (std::isinf(extension.from))
        return "measurement noise of " + names + " of a size of its own";
      return fmt::format("another measurement noise of {} from {:.6g} s on", names, extension.from);
    case ExtensionKind::process_noise_change:
      return fmt::format("another process noise from {:.6g} s on", extension.from);
    case ExtensionKind::quadratic_damping:
      return "quadratic damping of " + names;
    case ExtensionKind::dry_friction:
      return "dry friction of " + names;
    case ExtensionKind::cubic_stiffness:
      return fmt::format("a cubic term of {} in the motion of {}", extension.names[1],
                         extension.names[0]);
    case ExtensionKind::curved_input:
      return "a curve of what " + names + " does";
    case ExtensionKind::process_noise:
      break;
  }
  return "process noise of " + names;
}

std::vector<std::vector<std::string>> outputs_alike(const YamlNode& model) {
  return alike(model, "measurement");
}

std::vector<std::vector<std::string>> states_alike(const YamlNode& model) {
  return alike(model, "process");
}

bool has_continuous_time(const YamlNode& model) {
  const YamlNode* kind = find(formulas_part(model, "time"), "kind");
  return kind != nullptr && kind->text == "continuous";
}

bool moves_by(const YamlNode& model, const std::string& state, const std::string& name) {
  const YamlNode* formula = find(formulas_part(model, "dynamics"), state);
  bool found = false;
  if (formula == nullptr) return found;
  with_names(formula->text, [&](const std::string& part) {
    found = found || part == name;
    return part;
  });
  return found;
}

bool can_be_late(const YamlNode& model, const std::string& output) {
  if (!has_continuous_time(model)) return false;
  const YamlNode& dynamics = formulas_part(model, "dynamics");
  bool known = true, moves = false;
  with_names(formula_of(model, output), [&](const std::string& part) {
    const YamlNode* slope = find(dynamics, part);
    moves = moves || (slope != nullptr && slope->text != "0");
    for (const char* key : {"inputs", "let"}) {
      const YamlNode* names = find(model, key);
      if (names == nullptr) continue;
      const std::vector<YamlNode>& all = names->kind == Kind::list ? names->items : names->keys;
      known = known && std::none_of(all.begin(), all.end(),
                                    [&](const YamlNode& each) { return each.text == part; });
    }
    return part;
  });
  return known && moves;
}

YamlNode extended(YamlNode model, const ModelExtension& extension, double step) {
  formulas_part(model, "dynamics");
  if (!is_constant(extension.kind) && !is_curve(extension.kind)) formulas_part(model, "noise");
  if (extension.kind == ExtensionKind::lasting_error) add_lasting_errors(model, extension, step);
  if (extension.kind == ExtensionKind::coloured_process_noise)
    add_coloured_process_noise(model, extension, step);
  if (is_opposite(extension)) {
    const bool bias = extension.kind == ExtensionKind::bias;
    bias ? add_opposite_biases(model, extension) : add_opposite_scales(model, extension);
    return model;
  }
  if (extension.kind == ExtensionKind::cubic_stiffness) {
    add_cubic_stiffness(model, extension.names[0], extension.names[1]);
    return model;
  }
  for (std::size_t i = 0; i < extension.names.size(); ++i) {
    const std::string& name = extension.names[i];
    const double size = extension.size[i];
    switch (extension.kind) {
      case ExtensionKind::bias:
        add_bias(model, name);
        break;
      case ExtensionKind::scale:
        add_scale(model, name);
        break;
      case ExtensionKind::delay:
        add_delay(model, name);
        break;
      case ExtensionKind::curved_input:
        add_curved_input(model, name);
        break;
      case ExtensionKind::lasting_error:
      case ExtensionKind::coloured_process_noise:
      case ExtensionKind::cubic_stiffness:
        break;
      case ExtensionKind::measurement_noise_change:
        change_noise(model, "measurement", {name}, name, size, extension.from);
        break;
      case ExtensionKind::process_noise_change:
        change_noise(model, "process", names_with_noise(model, "process"), "process", size,
                     extension.from);
        break;
      case ExtensionKind::quadratic_damping:
        add_quadratic_damping(model, name);
        break;
      case ExtensionKind::dry_friction:
        add_dry_friction(model, name, size);
        break;
      case ExtensionKind::process_noise: {
        const std::string unit = unit_of(model, name);
        const bool density = has_continuous_time(model);
        const std::string of =
            unit.empty() ? "" : fmt::format("{0}*{0}{1}", unit, density ? "/s" : "");
        const double scale = unit_or_dimensionless(unit).scale;
        add_parameter(model, "q_" + name, size * size / (scale * scale) / (density ? step : 1.0),
                      of, 0.0);
        add_process_variance(model, name, "q_" + name);
        break;
      }
    }
  }
  return model;
}

std::string model_file_text(const YamlNode& model) { return yaml_text(model); }

}  // namespace identikal
