#include "identify/model/internal/formula_form.h"

#include <algorithm>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "identify/model/internal/condition_form.h"
#include "identify/model/internal/late_form.h"
#include "identify/model/internal/noise_form.h"
#include "identify/model/internal/recordings_form.h"
#include "identify/model/internal/reference_form.h"
#include "identify/model/internal/rest_form.h"
#include "identify/model/internal/scale_form.h"
#include "identify/model/internal/yaml_tree.h"
#include "identify/model/matrix_reader.h"
#include "identify/model/model_values.h"
#include "identify/model/row_order.h"
#include "lib/data/units.h"
#include "lib/model/linear_formulas.h"

namespace identikal {
namespace {

// The symbols of a model's formulas, in the order of lib/model/nonlinear_model.h.
struct Symbols {
  std::vector<std::string> names;
  std::vector<Dimension> dimensions;
  std::vector<Location> at;  // where each is declared; the time has no place
  bool with_units = true;

  void add(const YamlNode& name, const std::string& what, const std::string& unit) {
    check_name(name, what);
    if (name.text == "t") {
      throw InputError(
          name.at, fmt::format("{} is 't', the time", what), "another name",
          "formulas may use t; a column that holds it is named by time: {column: ...}");
    }
    const auto known = std::find(names.begin(), names.end(), name.text);
    if (known != names.end()) {
      const Location& first = at[known - names.begin()];
      throw InputError(name.at, fmt::format("{} is {} again", what, in_quotes(name.text)),
                       "a name of its own",
                       fmt::format("the first is on line {}, column {}", first.line, first.column));
    }
    add_known(name.text, dimension_of(unit_or_dimensionless(unit)), name.at);
  }
  void add_known(const std::string& name, const Dimension& dimension, const Location& place) {
    names.push_back(name);
    dimensions.push_back(dimension);
    at.push_back(place);
  }
};

// Calls body(), whose mistakes are those of the formula that stands in the node.
template <typename Body>
auto in_formula(const YamlNode& node, Body&& body) {
  try {
    return body();
  } catch (const FormulaError& error) {
    throw error.in_file(place_in(node, error.column()));
  }
}

void read_states(const YamlNode& node, Model& out, Symbols& symbols) {
  if (node.kind == YamlNode::Kind::list) {
    symbols.with_units = false;
    for (const YamlNode& name : node.items) {
      text_of(name, "a state");
      symbols.add(name, "a state", "");
      out.states.push_back({name.text, ""});
    }
  } else {
    check_mapping(node, "states");
    for (std::size_t i = 0; i < node.keys.size(); ++i) {
      const std::string& unit = text_of(node.items[i], "the unit of a state");
      if (!parse_unit(unit)) {
        const std::string nearest = nearest_unit(unit);
        throw InputError(
            node.items[i].at,
            fmt::format("state '{}' has the unknown unit {}", node.keys[i].text, in_quotes(unit)),
            "m, rad/s, ..., or 1",
            nearest.empty() ? "" : fmt::format("did you mean '{}'?", nearest));
      }
      symbols.add(node.keys[i], "a state", unit);
      out.states.push_back({node.keys[i].text, unit});
    }
  }
  if (out.states.empty() || static_cast<Eigen::Index>(out.states.size()) > kMaxSize) {
    throw InputError(node.at, fmt::format("{} states", out.states.size()),
                     fmt::format("1 to {}", kMaxSize));
  }
}

// The names of a mapping or a list of channels.
std::vector<const YamlNode*> channel_names(const YamlNode& node) {
  std::vector<const YamlNode*> out;
  for (std::size_t i = 0; i < node.items.size(); ++i) {
    out.push_back(node.kind == YamlNode::Kind::mapping ? &node.keys[i]
                                                       : find(node.items[i], "name"));
  }
  return out;
}

// Reads the formulas of one model file.
class FormulaReader {
 public:
  FormulaReader(const YamlNode& root, FormulaReading reading, Model& out)
      : root_(root), reading_(reading), out_(out), parameters_(read_named_parameters(root)) {}

  void read() {
    const std::string top = "the model file";
    read_states(required(root_, "states", top, "states: {NAME: UNIT}"), out_, symbols_);
    read_inputs();
    first_parameter_ = static_cast<int>(symbols_.names.size());
    for (std::size_t i = 0; i < parameters_.names.size(); ++i) {
      symbols_.add(parameters_.declared->keys[i], "a parameter", parameters_.set[i].unit);
    }
    symbols_.add_known("t", dimension_of(Unit{1.0, 0.0, {0, 0, 1, 0, 0}}), {});
    formulas_.states = static_cast<int>(out_.states.size());
    formulas_.inputs = static_cast<int>(out_.inputs.size() + formulas_.late.size());
    formulas_.parameters = static_cast<int>(parameters_.names.size());
    let_move(parameters_, out_.inputs);
    out_.recordings = read_recordings(root_, parameters_);
    read_time();
    read_definitions();
    read_dynamics();
    read_doses();
    read_rest();
    if (!formulas_.late.empty()) refuse_beside_late_inputs(root_, general_.inputs, rests_);
    const PhysicalNames physical{state_names(), read_outputs(), input_dimensions(),
                                 symbols_.with_units};
    read_spreads(physical.outputs);
    take_empty_doses_as_zero();
    LinearModel matrices = find_matrices();
    read_noise(is_linear_ ? root_ : with_factors_alone(root_, spreads_), physical, parameters_,
               matrices);
    out_.student = read_student(root_, parameters_);
    required(root_, "initial", top, "initial: {mean: {STATE: NUMBER}, sd: {STATE: NUMBER}}");
    read_initial(general_.rests_at ? with_start_at_rest(root_, out_.states) : root_, physical,
                 parameters_, matrices);
    if (reading_ == FormulaReading::as_written) give_start(matrices);
    if (!is_linear_) refuse_what_only_linear_models_have(matrices);
    decide_form(std::move(matrices));
    read_use_when();
    read_conditions(root_, out_);
    read_reference();
    refuse_unused_definitions();
    refuse_unused(parameters_);
    bound_sources(root_, out_.recordings, parameters_);
    check_start();
    out_.parameters = std::move(parameters_.set);
    add_spreads(root_, out_);
  }

 private:
  void read_inputs() {
    const YamlNode* inputs = find(root_, "inputs");
    if (inputs == nullptr) return;
    YamlNode written = *inputs;
    for (std::size_t i = 0; i < written.items.size(); ++i) {
      const std::optional<int> delay = take_unknown_delay(written.items[i], parameters_);
      if (delay) formulas_.late.push_back({static_cast<int>(i), 0, *delay});
    }
    out_.inputs = read_channels(written, "inputs", {});
    const std::vector<const YamlNode*> names = channel_names(*inputs);
    for (std::size_t i = 0; i < names.size(); ++i) {
      symbols_.add(*names[i], "an input", out_.inputs[i].unit);
    }
    // Slopes of late inputs, which no formula can name.
    for (ModelFormulas::LateInput& late : formulas_.late) {
      late.slope = static_cast<int>(symbols_.names.size()) - static_cast<int>(out_.states.size());
      symbols_.add_known("", Dimension{}, {});
    }
  }

  void read_time() {
    const YamlNode& time = required(root_, "time", "the model file", "");
    const YamlNode& kind = required(time, "kind", "time", "kind: continuous, or kind: discrete");
    formulas_.continuous = text_of(kind, "kind") == "continuous";
    const auto only_continuous = [&](const YamlNode& node) {
      if (formulas_.continuous) return;
      throw InputError(node.at, "a discrete-time model has nothing between samples",
                       "no such key here, or kind: continuous");
    };
    if (const YamlNode* inputs = find(time, "inputs")) {
      only_continuous(*inputs);
      const std::string& path = word_of(*inputs, "inputs", {"zoh", "foh", "pchip"});
      general_.inputs = path == "zoh"   ? InputPath::constant
                        : path == "foh" ? InputPath::linear
                                        : InputPath::pchip;
    }
    if (const YamlNode* sampling = find(time, "sampling")) {
      only_continuous(*sampling);
      general_.irregular = word_of(*sampling, "sampling", {"regular", "irregular"}) == "irregular";
      if (general_.irregular && out_.time.column.empty()) {
        throw InputError(sampling->at, "irregular sampling without time stamps", "column: NAME");
      }
    }
    if (const YamlNode* step = find(time, "integration_step")) {
      only_continuous(*step);
      general_.longest_step = read_si(*step, "s", "integration_step");
      if (!(general_.longest_step > 0.0)) {
        throw InputError(step->at, "integration_step is " + describe(*step), "a time above 0");
      }
    }
    if (const YamlNode* tolerance = find(time, "integration_tolerance")) {
      only_continuous(*tolerance);
      general_.integration_tolerance = read_plain_number(*tolerance, "integration_tolerance");
      if (!(general_.integration_tolerance >= 1e-10 && general_.integration_tolerance <= 1e-2)) {
        throw InputError(tolerance->at, "integration_tolerance is " + describe(*tolerance),
                         "1e-10 to 0.01: the error of a log-likelihood, relative");
      }
    }
  }

  Expression formula(const YamlNode& node, const std::string& what,
                     FormulaKind kind = FormulaKind::number) {
    return read_formula(node, what, symbols_.names, first_parameter_, parameters_, kind);
  }

  // Number i of `let`. Those from it on are known by name, to be refused by what they are.
  Expression definition(const YamlNode& let, std::size_t i) {
    std::vector<std::string> names = symbols_.names;
    for (std::size_t j = i; j < let.keys.size(); ++j) names.push_back(let.keys[j].text);
    const std::string name = in_quotes(let.keys[i].text);
    Expression out =
        read_formula(let.items[i], name, names, first_parameter_, parameters_, FormulaKind::number);
    for (const Expression::Node& each : out.nodes) {
      if (each.op != Op::symbol) continue;
      const auto symbol = static_cast<std::size_t>(each.symbol);
      if (symbol < symbols_.names.size()) continue;
      throw InputError(
          place_in(let.items[i], each.column),
          in_quotes(names[symbol]) +
              (symbol == symbols_.names.size() ? " is defined by itself" : " is defined later"),
          "names defined before it",
          symbol == symbols_.names.size() ? "" : fmt::format("move {} below it", name));
    }
    return out;
  }

  void refuse_unused_definitions() const {
    const YamlNode* let = find(root_, "let");
    if (let == nullptr) return;
    const std::size_t first = symbols_.names.size() - let->keys.size();
    std::vector<bool> used(let->keys.size());
    const auto look_at = [&](const Expression& formula) {
      for (const Expression::Node& each : formula.nodes) {
        const auto symbol = static_cast<std::size_t>(each.symbol);
        if (each.op == Op::symbol && symbol >= first) used[symbol - first] = true;
      }
    };
    for (const auto* formulas : {&formulas_.definitions, &formulas_.dynamics, &formulas_.outputs,
                                 &formulas_.doses, &references_}) {
      std::for_each(formulas->begin(), formulas->end(), look_at);
    }
    for (const NoiseSpread& spread : spreads_) look_at(spread.formula);
    for (std::size_t i = 0; i < used.size(); ++i) {
      if (used[i]) continue;
      throw InputError(let->keys[i].at, fmt::format("definition {} is not used anywhere",
                                                    in_quotes(let->keys[i].text)));
    }
  }

  void read_definitions() {
    const YamlNode* let = find(root_, "let");
    if (let == nullptr) return;
    check_mapping(*let, "let");
    for (std::size_t i = 0; i < let->keys.size(); ++i) {
      const YamlNode& name = let->keys[i];
      const YamlNode& node = let->items[i];
      formulas_.definitions.push_back(definition(*let, i));
      symbols_.add(name, "a definition", "");
      if (!symbols_.with_units) continue;
      symbols_.dimensions.back() = in_formula(node, [&] {
        return dimension_of(formulas_.definitions.back(),
                            std::span(symbols_.dimensions).first(symbols_.names.size() - 1));
      });
    }
  }

  void read_dynamics() {
    const YamlNode& node = required(root_, "dynamics", "the model file",
                                    "dynamics: {STATE: formula of its rate of change}");
    std::vector<std::string> names;
    for (const StateName& state : out_.states) names.push_back(state.name);
    check_keys(node, "dynamics", names);
    for (std::size_t i = 0; i < names.size(); ++i) {
      const YamlNode* given = find(node, names[i]);
      if (given == nullptr) {
        throw InputError(node.at, fmt::format("dynamics of state '{}' are missing", names[i]),
                         fmt::format("{}: formula", names[i]));
      }
      formulas_.dynamics.push_back(formula(*given, fmt::format("the dynamics of '{}'", names[i])));
      Dimension wanted = symbols_.dimensions[i];
      if (formulas_.continuous) wanted.exponent[2] -= 1.0;
      check(*given, formulas_.dynamics.back(), wanted,
            (formulas_.continuous ? "the rate of change of " : "the next ") + in_quotes(names[i]));
    }
  }

  // What is added to states at rows.
  void read_doses() {
    const YamlNode* node = find(root_, "doses");
    if (node == nullptr) return;
    std::vector<std::string> names;
    for (const StateName& state : out_.states) names.push_back(state.name);
    check_keys(*node, "doses", names);
    if (!general_.irregular) {
      throw InputError(node->at, "doses are given at rows, which a step would move",
                       "time: {sampling: irregular} with a column of time stamps");
    }
    formulas_.doses.assign(names.size(), parse_expression("0", symbols_.names));
    for (std::size_t i = 0; i < names.size(); ++i) {
      const YamlNode* given = find(*node, names[i]);
      if (given == nullptr) continue;
      const std::string what = fmt::format("the dose of '{}'", names[i]);
      Expression& dose = formulas_.doses[i] = formula(*given, what);
      check(*given, dose, symbols_.dimensions[i], what);
      const bool of_state =
          std::any_of(dose.nodes.begin(), dose.nodes.end(), [&](const Expression::Node& each) {
            return each.op == Op::symbol && is_state(each.symbol);
          });
      if (of_state) refuse_moving_noise(root_, "a dose that holds a state");
    }
  }

  // Does the symbol, or a definition that it is, hold one of these?
  template <class IsWanted>
  bool holds(int symbol, const IsWanted& is_wanted) const {
    if (is_wanted(symbol)) return true;
    const auto first = symbols_.names.size() - formulas_.definitions.size();
    if (static_cast<std::size_t>(symbol) < first) return false;
    const Expression& same = formulas_.definitions[static_cast<std::size_t>(symbol) - first];
    return std::any_of(same.nodes.begin(), same.nodes.end(), [&](const Expression::Node& each) {
      return each.op == Op::symbol && holds(each.symbol, is_wanted);
    });
  }
  bool is_state(int symbol) const {
    return holds(symbol, [&](int each) { return each < formulas_.states; });
  }

  // A start in a steady state, and rows at infinity.
  void read_rest() {
    const YamlNode* start = steady_state_start(root_);
    const bool at_end = has_infinity(root_);
    if (start == nullptr && !at_end) return;
    if (!formulas_.continuous) {
      throw InputError(start != nullptr ? start->at : find(root_, "time")->at,
                       "a steady state in discrete time", "time: {kind: continuous}");
    }
    refuse_time_in_dynamics();
    rests_ = true;
    if (at_end) refuse_moving_noise(root_, "time: {infinity: steady-state}");
    if (start != nullptr) general_.rests_at = inputs_at_rest(root_, out_.inputs);
  }

  void refuse_time_in_dynamics() const {
    const YamlNode& node = *find(root_, "dynamics");
    for (std::size_t i = 0; i < formulas_.dynamics.size(); ++i) {
      refuse_time(*find(node, out_.states[i].name), formulas_.dynamics[i],
                  "a steady state of dynamics that move with the time",
                  "dynamics of states, inputs and parameters");
    }
  }

  void refuse_time(const YamlNode& node, const Expression& formula, const char* what,
                   const char* expected) const {
    const int time = first_parameter_ + formulas_.parameters;
    for (const Expression::Node& each : formula.nodes) {
      if (each.op != Op::symbol || !holds(each.symbol, [&](int s) { return s == time; })) continue;
      throw InputError(place_in(node, each.column), what, expected);
    }
  }

  // Inputs that stand in doses alone.
  void take_empty_doses_as_zero() {
    const auto is_in = [](const Expression& formula, int input) {
      return std::any_of(formula.nodes.begin(), formula.nodes.end(), [&](const auto& each) {
        return each.op == Op::symbol && each.symbol == input;
      });
    };
    const auto is_in_any = [&](const std::vector<Expression>& formulas, int input) {
      return std::any_of(formulas.begin(), formulas.end(),
                         [&](const Expression& formula) { return is_in(formula, input); });
    };
    for (std::size_t i = 0; i < out_.inputs.size(); ++i) {
      const int input = formulas_.states + static_cast<int>(i);
      const bool elsewhere =
          is_in_any(formulas_.dynamics, input) || is_in_any(formulas_.definitions, input) ||
          is_in_any(formulas_.outputs, input) ||
          std::any_of(spreads_.begin(), spreads_.end(),
                      [&](const NoiseSpread& spread) { return is_in(spread.formula, input); });
      out_.inputs[i].empty_is_zero = is_in_any(formulas_.doses, input) && !elsewhere;
    }
  }

  void check(const YamlNode& node, const Expression& expression, const Dimension& wanted,
             const std::string& what) {
    if (!symbols_.with_units) return;
    in_formula(node, [&] { check_dimension(expression, symbols_.dimensions, wanted, what); });
  }

  std::vector<PhysicalName> state_names() const {
    std::vector<PhysicalName> out;
    for (std::size_t i = 0; i < out_.states.size(); ++i) {
      out.push_back({out_.states[i].name, symbols_.dimensions[i]});
    }
    return out;
  }

  std::vector<Dimension> input_dimensions() const {
    const auto first = symbols_.dimensions.begin() + formulas_.states;
    return {first, first + formulas_.inputs};
  }

  // Known up to whole turns: a likelihood that took it for more would have cliffs where it jumps.
  static bool is_of_a_turn(const Expression& formula, const ChannelSource& channel) {
    const bool angle = channel.unit.empty() || channel.unit == "rad" || channel.unit == "deg";
    return formula.nodes.back().op == Op::atan2 && angle && channel.delay == 0.0;
  }

  // The output is the logarithm of its formula, as its values are of the column's.
  void take_transform(const YamlNode& node, ChannelSource& channel) {
    const std::string& word = word_of(node, "transform", {"log", "log10"});
    const auto refuse = [&](bool wrong, const char* what) {
      if (wrong) throw InputError(node.at, fmt::format("{} of {}", word, what), "no transform");
    };
    refuse(channel.wraps, "an angle that wraps");
    refuse(channel.value.has_value(), "a known value");
    refuse(channel.scale != 1.0 || channel.offset != 0.0, "a column with scale or offset");
    const bool common = word == "log10";
    channel.transform = common ? Transform::common_logarithm : Transform::logarithm;
    std::vector<Expression::Node>& nodes = formulas_.outputs.back().nodes;
    const int whole = static_cast<int>(nodes.size()) - 1;
    nodes.push_back({.op = common ? Op::log10 : Op::log, .a = whole});
  }

  std::vector<PhysicalName> read_outputs() {
    const YamlNode& node = required(root_, "outputs", "the model file",
                                    "outputs: {NAME: {column: ..., unit: ..., equals: formula}}");
    std::vector<std::string> keys = kOutputKeys;
    keys.insert(keys.end(), {"equals", "wrap", "transform"});
    out_.outputs = read_channels(node, "outputs", {}, keys);
    std::vector<PhysicalName> out;
    for (std::size_t i = 0; i < out_.outputs.size(); ++i) {
      ChannelSource& channel = out_.outputs[i];
      const YamlNode* equals = find(node.items[i], "equals");
      const bool is_state = std::any_of(out_.states.begin(), out_.states.end(),
                                        [&](const auto& s) { return s.name == channel.name; });
      if (equals == nullptr && !is_state) {
        throw InputError(node.items[i].at, fmt::format("output '{}' is no state", channel.name),
                         "equals: formula");
      }
      const YamlNode own = equals == nullptr ? *channel_names(node)[i] : *equals;
      formulas_.outputs.push_back(formula(own, in_quotes(channel.name)));
      if (out_.time.infinite) {
        refuse_time(own, formulas_.outputs.back(),
                    "an output that moves with the time, at infinity",
                    "outputs of states, inputs and parameters");
      }
      const bool says = find(node.items[i], "wrap") != nullptr;
      if (!says && is_of_a_turn(formulas_.outputs.back(), channel)) channel.wraps = true;
      Dimension dimension;
      if (symbols_.with_units) {
        if (channel.unit.empty()) {
          dimension = in_formula(
              own, [&] { return dimension_of(formulas_.outputs.back(), symbols_.dimensions); });
        } else {
          dimension = dimension_of(*parse_unit(channel.unit));
          check(own, formulas_.outputs.back(), dimension, fmt::format("output '{}'", channel.name));
        }
      }
      if (const YamlNode* transform = find(node.items[i], "transform")) {
        take_transform(*transform, channel);
        out.push_back({channel.name, Dimension{}, own_sd(node, i), ""});
      } else {
        out.push_back({channel.name, dimension, own_sd(node, i), channel.unit});
      }
    }
    return out;
  }

  // Those of the measurement noise that hold more than parameters.
  void read_spreads(const std::vector<PhysicalName>& outputs) {
    std::vector<std::string> names;
    for (const PhysicalName& output : outputs) names.push_back(output.name);
    std::vector<std::string> scalers(symbols_.names.size());
    for (std::size_t i = 0; i < parameters_.names.size(); ++i) {
      // A unit would have to go with the factor that it belongs to.
      const bool plain = parameters_.set[i].unit.empty();
      if (plain) scalers[static_cast<std::size_t>(first_parameter_) + i] = parameters_.names[i];
    }
    spreads_ = moving_spreads(
        root_, names, formulas_, scalers, [&](const YamlNode& node, std::size_t i, bool variance) {
          const std::string what =
              fmt::format("the {} of '{}'", variance ? "variance" : "standard deviation", names[i]);
          Expression out = formula(node, what);
          Dimension wanted = outputs[i].dimension;
          for (double& e : wanted.exponent) e *= variance ? 2.0 : 1.0;
          const bool parameter = out.nodes.size() == 1;
          if (!parameter) check(node, out, wanted, what);
          return out;
        });
  }

  // A, B, C and D where the formulas are linear in the states, else matrices of the sizes of noise
  // and start.
  LinearModel find_matrices() {
    for (const ChannelSource& output : out_.outputs) general_.wraps.push_back(output.wraps);
    const bool wraps = std::count(general_.wraps.begin(), general_.wraps.end(), true) > 0;
    if (!wraps) general_.wraps.clear();
    LinearModel out;
    const bool scaled = std::any_of(spreads_.begin(), spreads_.end(),
                                    [](const NoiseSpread& each) { return each.of_state; });
    const bool may_be_linear = reading_ == FormulaReading::linear && !wraps && !scaled && !rests_ &&
                               formulas_.doses.empty() && formulas_.late.empty();
    if (may_be_linear && general_.inputs != InputPath::pchip && general_.longest_step == 0.0) {
      const bool held = general_.inputs == InputPath::constant;
      std::optional<LinearModel> linear = in_formula(*find(root_, "dynamics"), [&] {
        std::optional<LinearModel> same = linear_model_of(formulas_);
        if (same || !held) return same;
        return changing_linear_model_of(insert_formulas(formulas_));
      });
      is_linear_ = linear && !is_regression(*linear);
      if (is_linear_) out = *std::move(linear);
    }
    if (!is_linear_) {
      const auto ny = static_cast<Eigen::Index>(out_.outputs.size());
      out.continuous = formulas_.continuous;
      out.A.constant.setZero(formulas_.states, formulas_.states);
      out.B.constant.setZero(formulas_.states, 0);
      out.C.constant.setZero(ny, formulas_.states);
      out.D.constant.setZero(ny, 0);
    }
    out.irregular = is_linear_ && general_.irregular;
    out.hold = general_.inputs == InputPath::linear ? InputHold::linear : InputHold::constant;
    if (out_.time.step > 0.0) out.dt = out_.time.step;
    return out;
  }

  // Functions of each row's inputs alone: their formulas cost less than a filter that nothing moves.
  bool is_regression(const LinearModel& linear) const {
    const YamlNode* noise = find(root_, "noise");
    const bool disturbed =
        find(root_, "Q") != nullptr || (noise != nullptr && find(*noise, "process") != nullptr);
    const YamlNode* initial = find(root_, "initial");
    const bool known = initial != nullptr && initial->kind == YamlNode::Kind::mapping &&
                       initial->keys.size() == 1 && initial->keys[0].text == "mean";
    return changes(linear) && known && !disturbed && states_stay(linear);
  }

  void decide_form(LinearModel matrices) {
    if (is_linear_ && !changes(matrices) && out_.recordings.empty()) {
      out_.form = std::move(matrices);
      return;
    }
    if (is_linear_) {
      refuse_stationary_start_of_changes(root_, matrices);
      out_.form = changing_model(std::move(matrices), formulas_.inputs, parameters_.names.size());
      return;
    }
    general_.equations = in_formula(*find(root_, "dynamics"), [&] {
      return make_nonlinear_model(formulas_, Derivatives::second, known_parameters());
    });
    if (!spreads_.empty()) {
      general_.noise_scales =
          scales_of(spreads_, out_.outputs.size(), formulas_, known_parameters());
    }
    general_.late = formulas_.late;
    general_.noise = std::move(matrices);
    // What is read into a nonlinear model's matrices is used as it is, not sampled.
    general_.noise.continuous = false;
    general_.noise.hold = InputHold::constant;
    out_.form = std::move(general_);
  }

  void read_use_when() {
    const YamlNode* node = find(root_, "use_when");
    if (node == nullptr) return;
    const Expression condition = formula(*node, "use_when", FormulaKind::condition);
    const int first_input = formulas_.states;
    for (const Expression::Node& each : condition.nodes) {
      if (each.op != Op::symbol) continue;
      const bool known = each.symbol >= first_input && each.symbol < first_parameter_;
      if (known) continue;
      throw InputError(place_in(*node, each.column),
                       in_quotes(symbols_.names[each.symbol]) + " is no input",
                       "a condition on inputs, which are known before anything is estimated");
    }
    if (symbols_.with_units) {
      in_formula(*node, [&] { return dimension_of(condition, symbols_.dimensions); });
    }
    out_.use_when = condition;
  }

  void read_reference() {
    std::vector<std::string> states;
    for (const StateName& state : out_.states) states.push_back(state.name);
    const auto read = [&](const YamlNode& node, const ChannelSource& channel) {
      const std::string what = fmt::format("reference '{}'", channel.name);
      references_.push_back(formula(node, what));
      if (!channel.unit.empty()) {
        check(node, references_.back(), dimension_of(*parse_unit(channel.unit)), what);
      }
      return references_.back();
    };
    out_.references = read_references(root_, formulas_, states, known_parameters(), read);
  }

  // Of those that formulas can hold; whole matrices of noise are behind them.
  std::vector<bool> known_parameters() const {
    const std::vector<bool> differ = differs(out_.recordings, parameters_.set.size());
    std::vector<bool> out;
    for (std::size_t i = 0; i < parameters_.names.size(); ++i) {
      out.push_back(parameters_.set[i].fixed && !differ[i]);
    }
    return out;
  }

  // Of a start that linear models alone may have, what others can say: next to nothing.
  static void give_start(LinearModel& noise) {
    if (noise.initial == InitialState::given) return;
    const Eigen::Index n = noise.A.constant.rows();
    noise.initial = InitialState::given;
    noise.x0 = constant_matrix(Eigen::MatrixXd::Zero(n, 1));
    noise.P0 = constant_matrix(Eigen::MatrixXd::Identity(n, n));
  }

  void refuse_what_only_linear_models_have(const LinearModel& noise) const {
    if (noise.initial != InitialState::given) {
      throw InputError(find(root_, "initial")->at, "a nonlinear model has no such start",
                       "initial: {mean: {STATE: NUMBER}, sd: {STATE: NUMBER}}");
    }
    if (!noise.S.constant.isZero(0.0) || !parameters_in(noise.S).empty()) {
      throw InputError(find(root_, "S")->at, "S belongs to linear models", "no S");
    }
    for (const auto& [key, matrix] : {std::pair{"G", &noise.G}, std::pair{"Q", &noise.Q},
                                      std::pair{"R", &noise.R}, std::pair{"S", &noise.S}}) {
      if (!moves(*matrix)) continue;
      const YamlNode* node = find(root_, key);
      throw InputError(
          node != nullptr ? node->at : find(root_, "noise")->at,
          fmt::format("{} holds an input or the time, and the model is nonlinear", key),
          "numbers and parameters; formulas that are linear in the states may have a "
          "noise that changes");
    }
  }

  void check_start() {
    const std::optional<ModelFault> fault = fault_at(noise_model(out_), parameters_.set);
    if (!fault) return;
    const YamlNode* node = find(root_, fault->key);
    if (node == nullptr) node = find(root_, fault->key == "initial" ? "initial" : "noise");
    if (node == nullptr) node = find(root_, "dynamics");
    throw InputError(node->at, fault->text);
  }

  const YamlNode& root_;
  const FormulaReading reading_;
  Model& out_;
  NamedParameters parameters_;
  Symbols symbols_;
  int first_parameter_ = 0;
  ModelFormulas formulas_;
  std::vector<Expression> references_;
  std::vector<NoiseSpread> spreads_;
  bool rests_ = false;      // in a steady state, at the start or at infinity
  bool is_linear_ = false;  // in the states, whatever inputs and time are
  FormulaModel general_;    // until the form is decided
};

}  // namespace

void read_formulas(const YamlNode& root, FormulaReading reading, Model& out) {
  FormulaReader(root, reading, out).read();
}

}  // namespace identikal
