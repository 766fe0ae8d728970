#include "identify/model/builder.h"

#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

#include "identify/model/internal/yaml_tree.h"
#include "identify/model/model_file.h"
#include "lib/base/error.h"

namespace identikal {

// A builder fills the tree that a model file is read into, so that one reader gives both their meaning.
namespace {

using Kind = YamlNode::Kind;

std::string number_text(double value, const std::string& what) {
  if (!std::isfinite(value)) {
    throw std::invalid_argument(fmt::format("{} is {}; expected a finite number", what, value));
  }
  return fmt::format("{}", value);
}

void append_new(YamlNode& node, const std::string& key, YamlNode value, const std::string& what) {
  if (find(node, key) != nullptr) {
    throw std::invalid_argument(fmt::format("{} '{}' is given twice", what, key));
  }
  append(node, key, std::move(value));
}

YamlNode matrix(const MatrixEntries& entries) {
  YamlNode out = yaml_list();
  for (const std::vector<Entry>& row : entries.rows) {
    out.items.push_back(yaml_list());
    for (const Entry& entry : row) out.items.back().items.push_back(yaml_scalar(entry.text));
  }
  return out;
}

void add_parameter(YamlNode& model, const std::string& name, double start, const Limits& limits) {
  YamlNode node = yaml_mapping();
  append(node, "value", yaml_scalar(number_text(start, "the start of parameter '" + name + "'")));
  if (std::isfinite(limits.min)) append(node, "min", yaml_scalar(number_text(limits.min, "min")));
  if (std::isfinite(limits.max)) append(node, "max", yaml_scalar(number_text(limits.max, "max")));
  append_new(value_at(model, "parameters"), name, std::move(node), "parameter");
}

void add_known(YamlNode& model, const std::string& name, double value) {
  append_new(value_at(model, "parameters"), name,
             yaml_scalar(number_text(value, "parameter '" + name + "'")), "parameter");
}

void add_constraint(YamlNode& model, const std::string& condition) {
  if (find(model, "constraints") == nullptr) append(model, "constraints", yaml_list());
  value_at(model, "constraints").items.push_back(yaml_scalar(condition));
}

// A channel of a recording in memory: nothing is read from a file, so its column has its name.
YamlNode channel(const std::string& name) {
  YamlNode out = yaml_mapping();
  append(out, "column", yaml_scalar(name));
  return out;
}

void add_channels(YamlNode& model, const char* key, std::vector<std::string> names,
                  const std::string& letter, std::size_t size) {
  if (names.empty()) {
    for (std::size_t i = 1; i <= size; ++i) {
      names.push_back(size == 1 ? letter : letter + std::to_string(i));
    }
  }
  for (const std::string& name : names) append_new(value_at(model, key), name, channel(name), key);
}

void set_step(YamlNode& model, double seconds) {
  if (!(seconds > 0.0)) {
    throw std::invalid_argument(fmt::format("the step is {} s; expected a time above 0", seconds));
  }
  value_at(value_at(model, "time"), "step") = yaml_scalar(number_text(seconds, "the step"));
}

YamlNode noise_covariance(const NoiseCovariance& given, std::size_t size, YamlNode& model) {
  using Structure = NoiseCovariance::Structure;
  if (given.structure == Structure::as_written) return matrix(given.entries);
  if (given.structure == Structure::full) {
    YamlNode out = yaml_mapping();
    append(out, "structure", yaml_scalar("full"));
    append(out, "start", matrix(given.entries));
    return out;
  }
  for (const auto& [name, start] : given.unknown) {
    if (!(start > 0.0)) {
      throw std::invalid_argument(
          fmt::format("variance '{}' starts at {}; expected a number above 0", name, start));
    }
    add_parameter(model, name, start, {0.0});
  }
  if (given.structure == Structure::diagonal) size = given.unknown.size();
  YamlNode out = yaml_list();
  for (std::size_t i = 0; i < size; ++i) {
    out.items.push_back(yaml_list());
    const std::string& name = given.unknown[given.unknown.size() == 1 ? 0 : i].first;
    for (std::size_t j = 0; j < size; ++j) {
      out.items.back().items.push_back(yaml_scalar(i == j ? name : "0"));
    }
  }
  return out;
}

// A mistake in the tree is the caller's, who has no file to look at.
Model finished(YamlNode model, const std::string& name) {
  if (find(model, "name") == nullptr) append(model, "name", yaml_scalar(name));
  append(model, "identikal", yaml_scalar("1"));
  const bool stepped =
      find(model, "time") != nullptr && find(*find(model, "time"), "step") != nullptr;
  if (!stepped) value_at(value_at(model, "time"), "column") = yaml_scalar("t");
  try {
    Model out = model_of(model);
    if (!stepped) out.time.column.clear();
    return out;
  } catch (const InputError& error) {
    throw std::invalid_argument(error.what());
  }
}

std::size_t columns_of(const YamlNode* node) {
  return node == nullptr || node->items.empty() ? 0 : node->items.front().items.size();
}

}  // namespace

Entry::Entry(double value) : text(number_text(value, "an entry of a matrix")) {}

MatrixEntries::MatrixEntries(const Eigen::MatrixXd& values) {
  for (Eigen::Index i = 0; i < values.rows(); ++i) {
    rows.emplace_back(values.row(i).begin(), values.row(i).end());
  }
}

MatrixEntries::MatrixEntries(std::initializer_list<std::initializer_list<Entry>> given) {
  for (const auto& row : given) rows.emplace_back(row);
}

NoiseCovariance variance(const std::string& name, double start) {
  NoiseCovariance out = variances({{name, start}});
  out.structure = NoiseCovariance::Structure::times_identity;
  return out;
}

NoiseCovariance variances(const std::vector<std::pair<std::string, double>>& unknown) {
  NoiseCovariance out(0.0);
  out.structure = NoiseCovariance::Structure::diagonal;
  out.unknown = unknown;
  return out;
}

NoiseCovariance full_covariance(const Eigen::MatrixXd& start) {
  NoiseCovariance out(start);
  out.structure = NoiseCovariance::Structure::full;
  return out;
}

LinearModelBuilder& LinearModelBuilder::A(const MatrixEntries& entries) {
  value_at(model_, "A") = matrix(entries);
  return *this;
}
LinearModelBuilder& LinearModelBuilder::B(const MatrixEntries& entries) {
  value_at(model_, "B") = matrix(entries);
  return *this;
}
LinearModelBuilder& LinearModelBuilder::C(const MatrixEntries& entries) {
  value_at(model_, "C") = matrix(entries);
  return *this;
}
LinearModelBuilder& LinearModelBuilder::D(const MatrixEntries& entries) {
  value_at(model_, "D") = matrix(entries);
  return *this;
}
LinearModelBuilder& LinearModelBuilder::G(const MatrixEntries& entries) {
  value_at(model_, "G") = matrix(entries);
  return *this;
}
LinearModelBuilder& LinearModelBuilder::S(const MatrixEntries& entries) {
  value_at(model_, "S") = matrix(entries);
  return *this;
}
LinearModelBuilder& LinearModelBuilder::process_noise(NoiseCovariance Q) {
  Q_ = std::move(Q);
  return *this;
}
LinearModelBuilder& LinearModelBuilder::measurement_noise(NoiseCovariance R) {
  R_ = std::move(R);
  return *this;
}
LinearModelBuilder& LinearModelBuilder::parameter(const std::string& name, double start,
                                                  const Limits& limits) {
  add_parameter(model_, name, start, limits);
  return *this;
}
LinearModelBuilder& LinearModelBuilder::known(const std::string& name, double value) {
  add_known(model_, name, value);
  return *this;
}
LinearModelBuilder& LinearModelBuilder::inputs(const std::vector<std::string>& names) {
  add_channels(model_, "inputs", names, "", 0);
  return *this;
}
LinearModelBuilder& LinearModelBuilder::outputs(const std::vector<std::string>& names) {
  add_channels(model_, "outputs", names, "", 0);
  return *this;
}
LinearModelBuilder& LinearModelBuilder::step(double seconds) {
  set_step(model_, seconds);
  return *this;
}
LinearModelBuilder& LinearModelBuilder::continuous(ProcessNoise noise) {
  value_at(value_at(model_, "time"), "kind") = yaml_scalar("continuous");
  value_at(value_at(model_, "noise"), "process") =
      yaml_scalar(noise == ProcessNoise::density ? "density" : "per-sample");
  return *this;
}
LinearModelBuilder& LinearModelBuilder::diffuse() {
  value_at(model_, "initial") = yaml_scalar("diffuse");
  return *this;
}
LinearModelBuilder& LinearModelBuilder::stationary() {
  value_at(model_, "initial") = yaml_scalar("stationary");
  return *this;
}
LinearModelBuilder& LinearModelBuilder::initial(const Eigen::VectorXd& mean,
                                                const Eigen::MatrixXd& covariance) {
  YamlNode& node = value_at(model_, "initial") = yaml_mapping();
  YamlNode entries = yaml_list();
  for (const double value : mean) {
    entries.items.push_back(yaml_scalar(number_text(value, "an entry of the initial mean")));
  }
  append(node, "mean", std::move(entries));
  append(node, "covariance", matrix(covariance));
  return *this;
}
LinearModelBuilder& LinearModelBuilder::constraint(const std::string& condition) {
  add_constraint(model_, condition);
  return *this;
}
LinearModelBuilder& LinearModelBuilder::name(const std::string& text) {
  value_at(model_, "name") = yaml_scalar(text);
  return *this;
}

LinearModelBuilder::operator Model() const {
  YamlNode model = model_;
  const YamlNode* A = find(model, "A");
  const YamlNode* C = find(model, "C");
  const std::pair<bool, const char*> needed[] = {{A != nullptr, "A"},
                                                 {C != nullptr, "C"},
                                                 {Q_.has_value(), "process_noise"},
                                                 {R_.has_value(), "measurement_noise"}};
  for (const auto& [given, what] : needed) {
    if (!given) throw std::invalid_argument(fmt::format("the model has no {}", what));
  }
  const std::size_t states = A->items.size(), outputs = C->items.size();
  if (find(model, "outputs") == nullptr) add_channels(model, "outputs", {}, "y", outputs);
  if (const std::size_t inputs = columns_of(find(model, "B"));
      inputs > 0 && find(model, "inputs") == nullptr) {
    add_channels(model, "inputs", {}, "u", inputs);
  }
  const std::size_t noises = columns_of(find(model, "G"));
  value_at(model, "Q") = noise_covariance(*Q_, noises > 0 ? noises : states, model);
  value_at(model, "R") = noise_covariance(*R_, outputs, model);
  return finished(std::move(model), "linear model");
}

FormulaModelBuilder& FormulaModelBuilder::state(const std::string& name,
                                                const std::string& dynamics) {
  append_new(value_at(model_, "dynamics"), name, yaml_scalar(dynamics), "state");
  YamlNode& states = value_at(model_, "states");
  states.kind = Kind::list;
  states.items.push_back(yaml_scalar(name));
  return *this;
}
FormulaModelBuilder& FormulaModelBuilder::input(const std::string& name) {
  append_new(value_at(model_, "inputs"), name, channel(name), "input");
  return *this;
}
FormulaModelBuilder& FormulaModelBuilder::late_input(const std::string& name,
                                                     const std::string& delay) {
  YamlNode node = channel(name);
  append(node, "delay", yaml_scalar(delay));
  append_new(value_at(model_, "inputs"), name, std::move(node), "inputs");
  return *this;
}
FormulaModelBuilder& FormulaModelBuilder::output(const std::string& name,
                                                 const std::string& equals) {
  YamlNode node = channel(name);
  if (!equals.empty()) append(node, "equals", yaml_scalar(equals));
  append_new(value_at(model_, "outputs"), name, std::move(node), "output");
  return *this;
}
FormulaModelBuilder& FormulaModelBuilder::define(const std::string& name,
                                                 const std::string& formula) {
  append_new(value_at(model_, "let"), name, yaml_scalar(formula), "definition");
  return *this;
}
FormulaModelBuilder& FormulaModelBuilder::parameter(const std::string& name, double start,
                                                    const Limits& limits) {
  add_parameter(model_, name, start, limits);
  return *this;
}
FormulaModelBuilder& FormulaModelBuilder::known(const std::string& name, double value) {
  add_known(model_, name, value);
  return *this;
}
FormulaModelBuilder& FormulaModelBuilder::process_variance(const std::string& state,
                                                           const Entry& value) {
  append_new(value_at(value_at(value_at(model_, "noise"), "process"), "variance"), state,
             yaml_scalar(value.text), "process noise of");
  return *this;
}
FormulaModelBuilder& FormulaModelBuilder::measurement_variance(const std::string& output,
                                                               const Entry& value) {
  append_new(value_at(value_at(value_at(model_, "noise"), "measurement"), "variance"), output,
             yaml_scalar(value.text), "measurement noise of");
  return *this;
}
FormulaModelBuilder& FormulaModelBuilder::initial(const std::string& state, const Entry& mean,
                                                  const Entry& sd) {
  YamlNode& initial = value_at(model_, "initial");
  append_new(value_at(initial, "mean"), state, yaml_scalar(mean.text), "the initial mean of");
  append_new(value_at(initial, "sd"), state, yaml_scalar(sd.text), "the initial sd of");
  return *this;
}
FormulaModelBuilder& FormulaModelBuilder::discrete() {
  discrete_ = true;
  return *this;
}
FormulaModelBuilder& FormulaModelBuilder::inputs_held(InputPath path) {
  value_at(value_at(model_, "time"), "inputs") = yaml_scalar(path == InputPath::constant ? "zoh"
                                                             : path == InputPath::linear ? "foh"
                                                                                         : "pchip");
  return *this;
}
FormulaModelBuilder& FormulaModelBuilder::step(double seconds) {
  set_step(model_, seconds);
  return *this;
}
FormulaModelBuilder& FormulaModelBuilder::constraint(const std::string& condition) {
  add_constraint(model_, condition);
  return *this;
}
FormulaModelBuilder& FormulaModelBuilder::name(const std::string& text) {
  value_at(model_, "name") = yaml_scalar(text);
  return *this;
}

FormulaModelBuilder::operator Model() const {
  YamlNode model = model_;
  value_at(value_at(model, "time"), "kind") = yaml_scalar(discrete_ ? "discrete" : "continuous");
  if (const YamlNode* states = find(model, "states")) {
    YamlNode& mean = value_at(value_at(model, "initial"), "mean");
    for (const YamlNode& state : std::vector<YamlNode>(states->items)) {
      if (find(mean, state.text) == nullptr) append(mean, state.text, yaml_scalar("0"));
    }
  }
  YamlNode& noise = value_at(model, "noise");
  if (find(noise, "process") != nullptr) {
    value_at(value_at(noise, "process"), "kind") =
        yaml_scalar(discrete_ ? "per-sample" : "density");
  }
  return finished(std::move(model), "formulas");
}

VehicleModelBuilder& VehicleModelBuilder::parameter(const std::string& name, double start,
                                                    const Limits& limits) {
  add_parameter(model_, name, start, limits);
  return *this;
}
VehicleModelBuilder& VehicleModelBuilder::known(const std::string& name, double value) {
  add_known(model_, name, value);
  return *this;
}
VehicleModelBuilder& VehicleModelBuilder::output(const std::string& name,
                                                 std::optional<double> sd) {
  append_new(value_at(model_, "outputs"), name, channel(name), "output");
  if (sd) {
    value_at(value_at(value_at(value_at(model_, "noise"), "measurement"), "sd"), name) =
        yaml_scalar(number_text(*sd, "the standard deviation of '" + name + "'"));
  }
  return *this;
}
VehicleModelBuilder& VehicleModelBuilder::sensor(const std::string& output,
                                                 const SensorPosition& position) {
  YamlNode node = yaml_mapping();
  append(node, "x", yaml_scalar(number_text(position.x, "x of a sensor")));
  append(node, "y", yaml_scalar(number_text(position.y, "y of a sensor")));
  append(node, "angle", yaml_scalar(number_text(position.angle, "the angle of a sensor")));
  append_new(value_at(model_, "sensors"), output, std::move(node), "sensor");
  return *this;
}
VehicleModelBuilder& VehicleModelBuilder::road_wheel_angle() {
  steering_ = "road_wheel_angle";
  return *this;
}
VehicleModelBuilder& VehicleModelBuilder::tyre(TyreCurve curve) {
  value_at(value_at(model_, "tyre"), "curve") = yaml_scalar(std::string(name_of(curve)));
  return *this;
}
VehicleModelBuilder& VehicleModelBuilder::min_speed(double metres_per_second) {
  value_at(model_, "use_when") =
      yaml_scalar(fmt::format("vx > {}", number_text(metres_per_second, "the least speed")));
  return *this;
}
VehicleModelBuilder& VehicleModelBuilder::max_gap(double seconds) {
  value_at(model_, "max_gap") = yaml_scalar(fmt::format("{} s", number_text(seconds, "max_gap")));
  return *this;
}
VehicleModelBuilder& VehicleModelBuilder::constraint(const std::string& condition) {
  add_constraint(model_, condition);
  return *this;
}
VehicleModelBuilder& VehicleModelBuilder::name(const std::string& text) {
  value_at(model_, "name") = yaml_scalar(text);
  return *this;
}

VehicleModelBuilder::operator Model() const {
  YamlNode model = model_;
  append(model, "model", yaml_scalar("single-track"));
  append(value_at(model, "inputs"), steering_, channel(steering_));
  append(value_at(model, "inputs"), "vx", channel("vx"));
  return finished(std::move(model), "vehicle");
}

}  // namespace identikal
