#include "identify/model/internal/noise_form.h"

#include <algorithm>
#include <optional>

#include <fmt/format.h>

#include "identify/model/internal/yaml_tree.h"
#include "identify/model/model_values.h"
#include "lib/data/units.h"
#include "lib/formula/formula_graph.h"
#include "lib/model/linear_formulas.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

std::vector<std::string> names_in(const std::vector<PhysicalName>& all) {
  std::vector<std::string> out;
  for (const PhysicalName& each : all) out.push_back(each.name);
  return out;
}

// Of NamedParameters::symbols(). A parameter without a unit stands for any quantity here, in SI.
std::vector<Dimension> symbol_dimensions(const NamedParameters& parameters,
                                         const std::vector<Dimension>& of_inputs) {
  std::vector<Dimension> out;
  for (std::size_t i = 0; i < parameters.names.size(); ++i) {
    const std::string& unit = parameters.set[i].unit;
    out.push_back(dimension_of(unit_or_dimensionless(unit)));
    out.back().plain = unit.empty();
  }
  if (parameters.moving.empty()) return out;
  out.insert(out.end(), of_inputs.begin(), of_inputs.end());
  out.push_back(dimension_of(Unit{1.0, 0.0, {0, 0, 1, 0, 0}}));
  return out;
}

// What a dimension becomes: to the power `power`, per second^(rate).
Dimension scaled(Dimension dimension, double power, double rate) {
  for (double& e : dimension.exponent) e *= power;
  dimension.exponent[2] -= rate;
  return dimension;
}

// A number with or without a unit; nothing where it is none.
std::optional<double> number_in_si(const YamlNode& node, const std::string& what,
                                   const Dimension& wanted, bool with_units, bool spread) {
  const std::optional<Quantity> quantity = split_quantity(text_of(node, what));
  if (!quantity || !(quantity->unit.empty() || parse_unit(quantity->unit))) return std::nullopt;
  const Unit unit = unit_or_dimensionless(quantity->unit);
  if (!quantity->unit.empty() && with_units && !fits(dimension_of(unit), wanted)) {
    throw InputError(node.at, fmt::format("{} is {}", what, describe(node)),
                     in_words(wanted) + ", or a number in SI");
  }
  const double value = unit.to_si(quantity->number);
  if (spread && !(value >= 0.0)) {
    throw InputError(node.at, fmt::format("{} {} is negative", what, describe(node)));
  }
  return value;
}

// Formulas that are gathered for one matrix.
struct Gathered {
  Gathered(NamedParameters& named, const std::vector<Dimension>& of_inputs, LinearModel& linear)
      : parameters(named),
        model(linear),
        dimensions(symbol_dimensions(named, of_inputs)),
        graph(graph_of(named)),
        symbols(symbols_of(graph)) {}

  NamedParameters& parameters;
  LinearModel& model;
  std::vector<Dimension> dimensions;
  FormulaGraph graph;
  std::vector<FormulaGraph::Id> symbols;
  std::vector<PlacedFormula> placed;

  void place() { place_formulas(graph, placed, parameters.places(), model); }

  // A quantity such as "0.5 deg/s", or a formula. @param spread  it cannot be negative
  FormulaGraph::Id read(const YamlNode& node, const std::string& what, const Dimension& wanted,
                        bool with_units, bool spread) {
    if (const auto number = number_in_si(node, what, wanted, with_units, spread)) {
      return graph.number(*number);
    }
    const Expression formula = read_formula(node, what, parameters.symbols(), 0, parameters);
    if (with_units) {
      try {
        check_dimension(formula, dimensions, wanted, what);
      } catch (const FormulaError& error) {
        throw error.in_file(place_in(node, error.column()));
      }
    }
    const bool is_parameter = formula.nodes.size() == 1 && formula.nodes[0].op == Op::symbol &&
                              formula.nodes[0].symbol < parameters.places().parameters;
    if (spread && is_parameter) {
      bound_at_zero(parameters, formula.nodes[0].symbol, what);
    }
    return graph.insert(formula, symbols);
  }

  // The variance of an output that says its standard deviation itself.
  void place_own_sd(const PhysicalName& output, ParametrisedMatrix& R, int row, bool with_units) {
    const std::string what = fmt::format("the standard deviation of '{}'", output.name);
    FormulaGraph::Id sd;
    if (const std::optional<double> bare = plain_number(text_of(*output.sd, what))) {
      if (!(*bare > 0.0)) {
        throw InputError(output.sd->at, fmt::format("sd is {}", describe(*output.sd)), "above 0");
      }
      sd = graph.number(*bare * unit_or_dimensionless(output.unit).scale);
    } else {
      sd = read(*output.sd, what, output.dimension, with_units, true);
    }
    placed.push_back({&R, row, row, graph.operation(Op::multiply, sd, sd)});
  }
};

// Of what a diagonal covariance is.
struct NamedNoise {
  const char* what;
  const std::vector<PhysicalName>& all;
  const std::vector<Dimension>& inputs;
  bool with_units;  // else no dimension is checked
  bool density;
  bool every_one;  // must be given; else those without are zero
};

// The diagonal of a covariance from {sd: {name: ...}} or {variance: {name: ...}}.
ParametrisedMatrix read_spreads(const YamlNode& node, const NamedNoise& noise,
                                NamedParameters& parameters, LinearModel& model) {
  const std::vector<PhysicalName>& all = noise.all;
  const YamlNode* sd = find(node, "sd");
  const YamlNode* variance = find(node, "variance");
  if ((sd == nullptr) == (variance == nullptr)) {
    throw InputError(node.at, std::string(noise.what) + " needs one of 'sd' and 'variance'",
                     fmt::format("sd: {{{}: NUMBER or formula}}", all.front().name));
  }
  const std::string key = sd != nullptr ? "sd" : "variance";
  const YamlNode& given = sd != nullptr ? *sd : *variance;
  check_keys(given, fmt::format("{} of the {}", key, noise.what), names_in(all));
  ParametrisedMatrix out;
  const auto size = static_cast<Index>(all.size());
  out.constant.setZero(size, size);
  Gathered gathered(parameters, noise.inputs, model);
  for (int i = 0; i < size; ++i) {
    const PhysicalName& name = all[i];
    const YamlNode* entry = find(given, name.name);
    if (name.sd != nullptr) {
      if (entry != nullptr) {
        throw InputError(entry->at,
                         fmt::format("{} of '{}', which has an sd of its own", key, name.name),
                         "one of the two");
      }
      gathered.place_own_sd(name, out, i, noise.with_units);
      continue;
    }
    if (entry == nullptr) {
      if (!noise.every_one) continue;
      throw InputError(given.at, fmt::format("{} of '{}' is missing", key, name.name),
                       fmt::format("{}: NUMBER or formula", name.name));
    }
    const double power = sd != nullptr ? 1.0 : 2.0;
    const Dimension wanted = scaled(name.dimension, power, noise.density ? 0.5 * power : 0.0);
    FormulaGraph::Id value = gathered.read(
        *entry, fmt::format("the {} of '{}'", sd ? "standard deviation" : "variance", name.name),
        wanted, noise.with_units, true);
    if (sd != nullptr) value = gathered.graph.operation(Op::multiply, value, value);
    gathered.placed.push_back({&out, i, i, value});
  }
  gathered.place();
  return out;
}

// The value that every state of a mapping has, as a column or a diagonal.
ParametrisedMatrix read_by_state(const YamlNode& given, const std::string& key,
                                 const PhysicalNames& physical, NamedParameters& parameters,
                                 LinearModel& model) {
  const bool spread = key == "sd";
  check_keys(given, key, names_in(physical.states));
  const auto n = static_cast<Index>(physical.states.size());
  ParametrisedMatrix out;
  out.constant.setZero(n, spread ? n : 1);
  Gathered gathered(parameters, physical.inputs, model);
  for (int i = 0; i < n; ++i) {
    const PhysicalName& state = physical.states[i];
    const YamlNode* entry = find(given, state.name);
    if (entry == nullptr) {
      if (spread) continue;
      throw InputError(given.at, fmt::format("{} of '{}' is missing", key, state.name),
                       fmt::format("{}: NUMBER or formula", state.name));
    }
    FormulaGraph::Id value =
        gathered.read(*entry, fmt::format("the initial {} of '{}'", key, state.name),
                      state.dimension, physical.with_units, spread);
    if (spread) value = gathered.graph.operation(Op::multiply, value, value);
    gathered.placed.push_back({&out, i, spread ? i : 0, value});
  }
  gathered.place();
  return out;
}

// R, which outputs that say their standard deviation themselves are no part of.
ParametrisedMatrix read_measurement_covariance(const YamlNode& node, const PhysicalNames& physical,
                                               Index ny, NamedParameters& parameters,
                                               LinearModel& model) {
  const auto has_sd = [](const PhysicalName& output) { return output.sd != nullptr; };
  const bool all_in_R = std::none_of(physical.outputs.begin(), physical.outputs.end(), has_sd);
  if (all_in_R) {
    return read_noise_covariance(node, "R", {ny, ny, "outputs x outputs"}, parameters, model);
  }
  std::vector<int> place;  // of R's rows among all outputs
  for (int i = 0; i < static_cast<int>(ny); ++i) {
    if (!has_sd(physical.outputs[static_cast<std::size_t>(i)])) place.push_back(i);
  }
  const auto size = static_cast<Index>(place.size());
  if (node.kind == YamlNode::Kind::mapping) {
    throw InputError(node.at, "R is estimated as a whole, and an output has an sd of its own",
                     "R by its entries, or no sd at the output");
  }
  const ParametrisedMatrix written = read_covariance(
      node, "R", {size, size, "outputs without an sd x outputs without an sd"}, parameters, model);
  ParametrisedMatrix out;
  out.constant.setZero(ny, ny);
  for (Index i = 0; i < size; ++i) {
    for (Index j = 0; j < size; ++j) out.constant(place[i], place[j]) = written.constant(i, j);
  }
  out.entries = written.entries;
  out.formulas = written.formulas;
  for (auto& entry : out.entries)
    entry = {place[entry.row], place[entry.col], entry.parameter, entry.factor};
  for (auto& formula : out.formulas) {
    formula.row = place[formula.row];
    formula.col = place[formula.col];
  }
  Gathered gathered(parameters, physical.inputs, model);
  for (int i = 0; i < static_cast<int>(ny); ++i) {
    const PhysicalName& output = physical.outputs[static_cast<std::size_t>(i)];
    if (has_sd(output)) gathered.place_own_sd(output, out, i, physical.with_units);
  }
  gathered.place();
  return out;
}

void read_process_kind(const YamlNode& node, bool density_allowed, LinearModel& model) {
  const bool density = word_of(node, "process", {"per-sample", "density"}) == "density";
  if (density && !density_allowed) {
    throw InputError(node.at, "process noise is a density in a discrete-time model",
                     "process: per-sample, or time: {kind: continuous, ...}");
  }
  model.noise = density ? ProcessNoise::density : ProcessNoise::per_sample;
}

// Does the noise block say it by names, so that the matrix `key` is not to be given too?
bool by_names(const YamlNode& root, const YamlNode* part, const char* key) {
  if (part == nullptr || part->kind != YamlNode::Kind::mapping) return false;
  if (const YamlNode* matrix = find(root, key)) {
    throw InputError(matrix->at, fmt::format("{} is given alongside the noise by names", key),
                     "one of the two");
  }
  return true;
}

std::vector<std::string> state_names(const PhysicalNames& physical, Index n) {
  std::vector<std::string> out = names_in(physical.states);
  for (Index i = 1; physical.states.empty() && i <= n; ++i) out.push_back(fmt::format("x{}", i));
  return out;
}

bool moves_state(const ParametrisedMatrix& A, Index i, Index j) {
  const auto here = [&](const auto& e) { return e.row == i && e.col == j; };
  return A.constant(i, j) != 0.0 || std::any_of(A.entries.begin(), A.entries.end(), here) ||
         std::any_of(A.formulas.begin(), A.formulas.end(), here);
}

// States that start in their steady state: it has to be their own.
void add_stationary(const std::vector<bool>& stationary, const Location& at,
                    const std::vector<std::string>& names, LinearModel& model) {
  const auto n = static_cast<Index>(names.size());
  for (Index i = 0; i < n; ++i) {
    if (!stationary[static_cast<std::size_t>(i)]) continue;
    model.stationary.push_back(i);
    for (Index j = 0; j < n; ++j) {
      if (stationary[static_cast<std::size_t>(j)] || !moves_state(model.A, i, j)) continue;
      throw InputError(
          at,
          fmt::format("'{}' starts in its steady state, and '{}', which does not, "
                      "moves it",
                      names[static_cast<std::size_t>(i)], names[static_cast<std::size_t>(j)]),
          "the same start of both");
    }
  }
}

// {diffuse: [level]}: the other states start in their steady state.
void read_partly_diffuse(const YamlNode& initial, const YamlNode& diffuse,
                         const std::vector<std::string>& names, LinearModel& model) {
  check_keys(initial, "initial", {"diffuse"});
  if (diffuse.kind != YamlNode::Kind::list || diffuse.items.empty()) {
    throw InputError(diffuse.at, "diffuse is " + describe(diffuse), "a list of states");
  }
  std::vector<bool> stationary(names.size(), true);
  for (const YamlNode& each : diffuse.items) {
    const std::string& name = word_of(each, "a diffuse state", names);
    stationary[static_cast<std::size_t>(std::find(names.begin(), names.end(), name) -
                                        names.begin())] = false;
  }
  model.initial = InitialState::partly_diffuse;
  add_stationary(stationary, diffuse.at, names, model);
}

// {mean: 0, sd: 1} of one state; a number alone is a start that is known.
LinearModel::StartOfState read_start_of(const YamlNode& node, const std::string& name, Index state,
                                        const PhysicalNames& physical) {
  const bool has_names = !physical.states.empty();
  const Dimension wanted =
      has_names ? physical.states[static_cast<std::size_t>(state)].dimension : Dimension();
  const auto number = [&](const YamlNode& entry, const char* what, bool spread) {
    const std::string about = fmt::format("the initial {} of '{}'", what, name);
    if (const auto value = number_in_si(entry, about, wanted, physical.with_units, spread)) {
      return *value;
    }
    throw InputError(
        entry.at, fmt::format("{} is {}", about, describe(entry)),
        has_names
            ? "a number, diffuse or stationary; or of every state a mean, a parameter or a formula"
            : "a number, diffuse or stationary");
  };
  if (node.kind != YamlNode::Kind::mapping) return {state, number(node, "value", false), 0.0};
  check_keys(node, name, {"mean", "sd"});
  LinearModel::StartOfState out{state, 0.0, 0.0};
  if (const YamlNode* mean = find(node, "mean")) out.mean = number(*mean, "mean", false);
  out.sd = number(required(node, "sd", name, "{mean: ..., sd: ...}"), "sd", true);
  return out;
}

// All states known by mean and standard deviation: the start that every filter has.
void start_given(LinearModel& model) {
  const auto n = static_cast<Index>(model.known.size());
  VectorXd mean(n), variance(n);
  for (const LinearModel::StartOfState& each : model.known) {
    mean[each.state] = each.mean;
    variance[each.state] = each.sd * each.sd;
  }
  model.known.clear();
  model.initial = InitialState::given;
  model.x0 = constant_matrix(mean);
  model.P0 = constant_matrix(MatrixXd(variance.asDiagonal()));
}

// {level: diffuse, error: stationary, bias: {mean: 0, sd: 1}}: every state by its name.
void read_initial_by_state(const YamlNode& initial, const std::vector<std::string>& names,
                           const PhysicalNames& physical, LinearModel& model) {
  check_keys(initial, "initial", names);
  std::vector<bool> stationary(names.size(), false);
  for (std::size_t i = 0; i < names.size(); ++i) {
    const YamlNode* node = find(initial, names[i]);
    if (node == nullptr) {
      throw InputError(initial.at, fmt::format("the start of '{}' is missing", names[i]),
                       names[i] + ": diffuse, stationary or {mean: ..., sd: ...}");
    }
    const auto state = static_cast<Index>(i);
    if (node->kind == YamlNode::Kind::scalar && node->text == "stationary") {
      stationary[i] = true;
    } else if (node->kind != YamlNode::Kind::scalar || node->text != "diffuse") {
      model.known.push_back(read_start_of(*node, names[i], state, physical));
    }
  }
  if (model.known.size() == names.size()) {
    start_given(model);
    return;
  }
  model.initial = InitialState::partly_diffuse;
  add_stationary(stationary, initial.at, names, model);
}

// Is it keyed by states?
bool is_by_state(const YamlNode& initial) {
  return std::none_of(initial.keys.begin(), initial.keys.end(), [](const YamlNode& key) {
    return key.text == "mean" || key.text == "sd" || key.text == "covariance" ||
           key.text == "diffuse";
  });
}

// {phi: 10 deg, w: {mean: w0, sd: s}} of states that all have a mean is {mean: {...}, sd: {...}}, where formulas may
// stand. A word that is no parameter's name is not taken for a formula: the reader of words says what it may be.
std::optional<YamlNode> as_moments(const YamlNode& by_state, const std::vector<std::string>& states,
                                   const std::vector<std::string>& parameters) {
  YamlNode mean = yaml_mapping(), sd = yaml_mapping(), out = yaml_mapping();
  out.at = mean.at = sd.at = by_state.at;
  for (const std::string& state : states) {
    const YamlNode* entry = find(by_state, state);
    if (entry == nullptr) return std::nullopt;
    const YamlNode* of_mean = entry;
    if (entry->kind == YamlNode::Kind::mapping) {
      check_keys(*entry, state, {"mean", "sd"});
      of_mean = find(*entry, "mean");
      if (const YamlNode* spread = find(*entry, "sd")) append(sd, state, *spread);
    }
    if (of_mean == nullptr || of_mean->kind != YamlNode::Kind::scalar) return std::nullopt;
    const bool is_word = is_name(of_mean->text);
    if (is_word && !std::count(parameters.begin(), parameters.end(), of_mean->text)) {
      return std::nullopt;
    }
    append(mean, state, *of_mean);
  }
  append(out, "mean", mean);
  if (!sd.keys.empty()) append(out, "sd", sd);
  return out;
}

}  // namespace

void read_noise(const YamlNode& root, const PhysicalNames& physical, NamedParameters& parameters,
                LinearModel& model) {
  const Index n = model.A.constant.rows(), ny = model.C.constant.rows();
  const bool has_names = !physical.states.empty();
  const std::string top = "the model file";
  const YamlNode* noise = find(root, "noise");
  const YamlNode* process = nullptr;
  const YamlNode* measurement = nullptr;
  if (noise != nullptr) {
    check_keys(*noise, "noise", {"process", "measurement"});
    process = find(*noise, "process");
    measurement = find(*noise, "measurement");
    if (!has_names && measurement == nullptr) {
      process = &required(*noise, "process", "noise", "process: per-sample");
    }
    if (!has_names && measurement != nullptr) {
      check_keys(*measurement, "measurement", {"kind", "freedom"});
    }
  }

  if (has_names && by_names(root, process, "Q")) {
    check_keys(*process, "process", {"kind", "sd", "variance"});
    const YamlNode* kind = find(*process, "kind");
    if (kind == nullptr && model.continuous) {
      required(*process, "kind", "process", "kind: density, or kind: per-sample");
    }
    if (kind != nullptr) read_process_kind(*kind, model.continuous, model);
    if (const YamlNode* G = find(root, "G")) {
      throw InputError(G->at, "G is given alongside the noise by names", "one of the two");
    }
    model.G = constant_matrix(MatrixXd::Identity(n, n));
    const bool density = model.noise == ProcessNoise::density;
    model.Q = read_spreads(
        *process,
        {"process noise", physical.states, physical.inputs, physical.with_units, density, false},
        parameters, model);
  } else if (has_names && find(root, "Q") == nullptr) {
    if (process != nullptr) {
      throw InputError(process->at, "process is " + describe(*process),
                       "{kind: per-sample, sd: {STATE: NUMBER}}, or a matrix Q alongside it");
    }
    model.G = constant_matrix(MatrixXd::Identity(n, n));
    model.Q = constant_matrix(MatrixXd::Zero(n, n));
  } else {
    const YamlNode* G = find(root, "G");
    model.G = G == nullptr ? constant_matrix(MatrixXd::Identity(n, n))
                           : read_matrix(*G, "G", {n, kAnySize, "states x process noises"},
                                         parameters, model);
    const Index nw = model.G.constant.cols();
    model.Q =
        read_noise_covariance(required(root, "Q", top, "Q: covariance of the process noise"), "Q",
                              {nw, nw, "process noises x process noises"}, parameters, model);
    if (process != nullptr) {
      read_process_kind(*process, model.continuous, model);
    } else if (model.continuous) {
      throw InputError(root.at, "a continuous-time model does not say what its Q is",
                       "noise: {process: density} or noise: {process: per-sample}");
    }
  }

  if (has_names && by_names(root, measurement, "R")) {
    check_keys(*measurement, "measurement", {"kind", "sd", "variance", "freedom"});
    model.R = read_spreads(
        *measurement,
        {"measurement noise", physical.outputs, physical.inputs, physical.with_units, false, true},
        parameters, model);
  } else {
    const std::string example =
        has_names ? "noise: {measurement: {sd: {" + physical.outputs.front().name + ": ...}}}, or R"
                  : "R: covariance of the measurement noise";
    model.R = read_measurement_covariance(required(root, "R", top, example), physical, ny,
                                          parameters, model);
  }
  const Index nw = model.G.constant.cols();
  const YamlNode* S = find(root, "S");
  if (S != nullptr && model.noise == ProcessNoise::density) {
    throw InputError(S->at, "S does not apply to a noise density", "process: per-sample");
  }
  model.S = S == nullptr
                ? constant_matrix(MatrixXd::Zero(nw, ny))
                : read_matrix(*S, "S", {nw, ny, "process noises x outputs"}, parameters, model);
}

void read_initial(const YamlNode& root, const PhysicalNames& physical, NamedParameters& parameters,
                  LinearModel& model) {
  const YamlNode* node = find(root, "initial");
  if (node == nullptr) return;
  if (node->kind == YamlNode::Kind::list) {
    throw InputError(node->at, "initial is a list",
                     "stationary, diffuse, or {mean: [...], sd: [...]}");
  }
  if (node->kind != YamlNode::Kind::mapping) {
    std::vector<std::string> words{"stationary", "diffuse"};
    if (!physical.states.empty())
      words.emplace_back("steady-state");  // that formulas take as theirs
    model.initial = word_of(*node, "initial", words) == "diffuse" ? InitialState::diffuse
                                                                  : InitialState::stationary;
    return;
  }
  const std::vector<std::string> names = state_names(physical, model.A.constant.rows());
  std::optional<YamlNode> moments;
  if (!node->keys.empty() && is_by_state(*node)) {
    if (!physical.states.empty()) moments = as_moments(*node, names, parameters.names);
    if (!moments) {
      read_initial_by_state(*node, names, physical, model);
      return;
    }
    node = &*moments;
  }
  check_keys(*node, "initial", {"mean", "sd", "covariance", "diffuse"});
  if (const YamlNode* diffuse = find(*node, "diffuse")) {
    read_partly_diffuse(*node, *diffuse, names, model);
    return;
  }
  const bool has_names = !physical.states.empty();
  const YamlNode* sd = find(*node, "sd");
  const YamlNode* covariance = find(*node, "covariance");
  if ((sd != nullptr && covariance != nullptr) ||
      (sd == nullptr && covariance == nullptr && !has_names)) {
    throw InputError(node->at, "initial needs one of 'sd' and 'covariance'",
                     "initial: {mean: [...], sd: [...]}");
  }
  const Index n = model.A.constant.rows();
  const YamlNode& mean = required(*node, "mean", "initial", "mean: [...], one entry per state");
  const auto named = [&](const YamlNode& part) {
    return has_names && part.kind == YamlNode::Kind::mapping;
  };
  model.x0 = named(mean) ? read_by_state(mean, "mean", physical, parameters, model)
                         : read_column(mean, "mean", n, parameters, model);
  if (covariance != nullptr) {
    model.P0 =
        read_covariance(*covariance, "covariance", {n, n, "states x states"}, parameters, model);
  } else if (sd == nullptr) {
    model.P0 = constant_matrix(MatrixXd::Zero(n, n));
  } else if (named(*sd)) {
    model.P0 = read_by_state(*sd, "sd", physical, parameters, model);
  } else {
    const ParametrisedMatrix column = read_column(*sd, "sd", n, parameters, model);
    if (!column.entries.empty() || !column.formulas.empty()) {
      throw InputError(sd->at, "sd holds parameters", "numbers, or 'covariance' with variances");
    }
    for (Index i = 0; i < n; ++i) {
      if (column.constant(i, 0) >= 0.0) continue;
      const YamlNode& entry = sd->items[i];
      throw InputError(entry.at, fmt::format("sd {} is negative", describe(entry)));
    }
    model.P0 = constant_matrix(column.constant.col(0).cwiseAbs2().asDiagonal());
  }
  if (moves(model.x0) || moves(model.P0)) {
    throw InputError(node->at, "the initial state holds an input or the time",
                     "numbers and parameters");
  }
  model.initial = InitialState::given;
}

void refuse_stationary_start_of_changes(const YamlNode& root, const LinearModel& model) {
  const bool changes = moves(model.A) || moves(model.G) || moves(model.Q);
  const bool stationary = model.initial == InitialState::stationary || !model.stationary.empty();
  if (!stationary || !changes) return;
  const YamlNode* node = find(root, "initial");
  throw InputError(node == nullptr ? root.at : node->at,
                   "the start is stationary, and A or the process noise changes",
                   "initial: diffuse, or {mean: ..., sd: ...}");
}

std::optional<StudentNoise> read_student(const YamlNode& root, NamedParameters& parameters) {
  const YamlNode* noise = find(root, "noise");
  const YamlNode* measurement = noise != nullptr ? find(*noise, "measurement") : nullptr;
  if (measurement == nullptr || measurement->kind != YamlNode::Kind::mapping) return std::nullopt;
  const YamlNode* kind = find(*measurement, "kind");
  const YamlNode* freedom = find(*measurement, "freedom");
  const bool student =
      kind != nullptr && word_of(*kind, "kind", {"per-sample", "student"}) == "student";
  if (!student) {
    if (freedom == nullptr) return std::nullopt;
    throw InputError(freedom->at, "freedom belongs to Student's t", "kind: student beside it");
  }
  StudentNoise out;
  if (freedom == nullptr) return out;
  const std::string& text = text_of(*freedom, "freedom");
  const auto named = std::find(parameters.names.begin(), parameters.names.end(), text);
  if (named != parameters.names.end()) {
    out.parameter = static_cast<int>(named - parameters.names.begin());
    parameters.used[static_cast<std::size_t>(out.parameter)] = true;
    out.freedom = parameters.set[static_cast<std::size_t>(out.parameter)].scalar();
  } else {
    out.freedom = read_plain_number(*freedom, "freedom");
  }
  if (!(out.freedom >= 1.0)) {
    throw InputError(freedom->at, fmt::format("freedom is {}", describe(*freedom)),
                     "degrees of freedom, 1 or above, or the name of a parameter that is");
  }
  return out;
}

}  // namespace identikal
