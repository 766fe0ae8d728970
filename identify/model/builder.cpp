#include "identify/model/builder.h"

#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

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

YamlNode scalar(std::string text) {
  YamlNode out;
  out.kind = Kind::scalar;
  out.text = std::move(text);
  return out;
}

YamlNode list() {
  YamlNode out;
  out.kind = Kind::list;
  return out;
}

YamlNode mapping() {
  YamlNode out;
  out.kind = Kind::mapping;
  return out;
}

void append(YamlNode& node, const std::string& key, YamlNode value) {
  node.kind = Kind::mapping;
  node.keys.push_back(scalar(key));
  node.items.push_back(std::move(value));
}

// The value of a key, put there where there is none.
YamlNode& at(YamlNode& node, const std::string& key) {
  for (std::size_t i = 0; i < node.keys.size(); ++i) {
    if (node.keys[i].text == key) return node.items[i];
  }
  append(node, key, mapping());
  return node.items.back();
}

void append_new(YamlNode& node, const std::string& key, YamlNode value, const std::string& what) {
  if (find(node, key) != nullptr) {
    throw std::invalid_argument(fmt::format("{} '{}' is given twice", what, key));
  }
  append(node, key, std::move(value));
}

YamlNode matrix(const MatrixEntries& entries) {
  YamlNode out = list();
  for (const std::vector<Entry>& row : entries.rows) {
    out.items.push_back(list());
    for (const Entry& entry : row) out.items.back().items.push_back(scalar(entry.text));
  }
  return out;
}

void add_parameter(YamlNode& model, const std::string& name, double start, const Limits& limits) {
  YamlNode node = mapping();
  append(node, "value", scalar(number_text(start, "the start of parameter '" + name + "'")));
  if (std::isfinite(limits.min)) append(node, "min", scalar(number_text(limits.min, "min")));
  if (std::isfinite(limits.max)) append(node, "max", scalar(number_text(limits.max, "max")));
  append_new(at(model, "parameters"), name, std::move(node), "parameter");
}

void add_known(YamlNode& model, const std::string& name, double value) {
  append_new(at(model, "parameters"), name, scalar(number_text(value, "parameter '" + name + "'")),
             "parameter");
}

// A channel of a recording in memory: nothing is read from a file, so its column has its name.
YamlNode channel(const std::string& name) {
  YamlNode out = mapping();
  append(out, "column", scalar(name));
  return out;
}

void add_channels(YamlNode& model, const char* key, std::vector<std::string> names,
                  const std::string& letter, std::size_t size) {
  if (names.empty()) {
    for (std::size_t i = 1; i <= size; ++i) {
      names.push_back(size == 1 ? letter : letter + std::to_string(i));
    }
  }
  for (const std::string& name : names) append_new(at(model, key), name, channel(name), key);
}

void set_step(YamlNode& model, double seconds) {
  if (!(seconds > 0.0)) {
    throw std::invalid_argument(fmt::format("the step is {} s; expected a time above 0", seconds));
  }
  at(at(model, "time"), "step") = scalar(number_text(seconds, "the step"));
}

YamlNode noise_covariance(const NoiseCovariance& given, std::size_t size, YamlNode& model) {
  using Structure = NoiseCovariance::Structure;
  if (given.structure == Structure::as_written) return matrix(given.entries);
  if (given.structure == Structure::full) {
    YamlNode out = mapping();
    append(out, "structure", scalar("full"));
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
  YamlNode out = list();
  for (std::size_t i = 0; i < size; ++i) {
    out.items.push_back(list());
    const std::string& name = given.unknown[given.unknown.size() == 1 ? 0 : i].first;
    for (std::size_t j = 0; j < size; ++j) {
      out.items.back().items.push_back(scalar(i == j ? name : "0"));
    }
  }
  return out;
}

// A mistake in the tree is the caller's, who has no file to look at.
Model finished(YamlNode model, const std::string& name) {
  if (find(model, "name") == nullptr) append(model, "name", scalar(name));
  append(model, "identikal", scalar("1"));
  const bool stepped =
      find(model, "time") != nullptr && find(*find(model, "time"), "step") != nullptr;
  if (!stepped) at(at(model, "time"), "column") = scalar("t");
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
  at(model_, "A") = matrix(entries);
  return *this;
}
LinearModelBuilder& LinearModelBuilder::B(const MatrixEntries& entries) {
  at(model_, "B") = matrix(entries);
  return *this;
}
LinearModelBuilder& LinearModelBuilder::C(const MatrixEntries& entries) {
  at(model_, "C") = matrix(entries);
  return *this;
}
LinearModelBuilder& LinearModelBuilder::D(const MatrixEntries& entries) {
  at(model_, "D") = matrix(entries);
  return *this;
}
LinearModelBuilder& LinearModelBuilder::G(const MatrixEntries& entries) {
  at(model_, "G") = matrix(entries);
  return *this;
}
LinearModelBuilder& LinearModelBuilder::S(const MatrixEntries& entries) {
  at(model_, "S") = matrix(entries);
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
  at(at(model_, "time"), "kind") = scalar("continuous");
  at(at(model_, "noise"), "process") =
      scalar(noise == ProcessNoise::density ? "density" : "per-sample");
  return *this;
}
LinearModelBuilder& LinearModelBuilder::diffuse() {
  at(model_, "initial") = scalar("diffuse");
  return *this;
}
LinearModelBuilder& LinearModelBuilder::stationary() {
  at(model_, "initial") = scalar("stationary");
  return *this;
}
LinearModelBuilder& LinearModelBuilder::initial(const Eigen::VectorXd& mean,
                                                const Eigen::MatrixXd& covariance) {
  YamlNode& node = at(model_, "initial") = mapping();
  YamlNode entries = list();
  for (const double value : mean) {
    entries.items.push_back(scalar(number_text(value, "an entry of the initial mean")));
  }
  append(node, "mean", std::move(entries));
  append(node, "covariance", matrix(covariance));
  return *this;
}
LinearModelBuilder& LinearModelBuilder::name(const std::string& text) {
  at(model_, "name") = scalar(text);
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
  at(model, "Q") = noise_covariance(*Q_, noises > 0 ? noises : states, model);
  at(model, "R") = noise_covariance(*R_, outputs, model);
  return finished(std::move(model), "linear model");
}

FormulaModelBuilder& FormulaModelBuilder::state(const std::string& name,
                                                const std::string& dynamics) {
  append_new(at(model_, "dynamics"), name, scalar(dynamics), "state");
  YamlNode& states = at(model_, "states");
  states.kind = Kind::list;
  states.items.push_back(scalar(name));
  return *this;
}
FormulaModelBuilder& FormulaModelBuilder::input(const std::string& name) {
  append_new(at(model_, "inputs"), name, channel(name), "input");
  return *this;
}
FormulaModelBuilder& FormulaModelBuilder::output(const std::string& name,
                                                 const std::string& equals) {
  YamlNode node = channel(name);
  if (!equals.empty()) append(node, "equals", scalar(equals));
  append_new(at(model_, "outputs"), name, std::move(node), "output");
  return *this;
}
FormulaModelBuilder& FormulaModelBuilder::define(const std::string& name,
                                                 const std::string& formula) {
  append_new(at(model_, "let"), name, scalar(formula), "definition");
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
  append_new(at(at(at(model_, "noise"), "process"), "variance"), state, scalar(value.text),
             "process noise of");
  return *this;
}
FormulaModelBuilder& FormulaModelBuilder::measurement_variance(const std::string& output,
                                                               const Entry& value) {
  append_new(at(at(at(model_, "noise"), "measurement"), "variance"), output, scalar(value.text),
             "measurement noise of");
  return *this;
}
FormulaModelBuilder& FormulaModelBuilder::initial(const std::string& state, const Entry& mean,
                                                  const Entry& sd) {
  YamlNode& initial = at(model_, "initial");
  append_new(at(initial, "mean"), state, scalar(mean.text), "the initial mean of");
  append_new(at(initial, "sd"), state, scalar(sd.text), "the initial sd of");
  return *this;
}
FormulaModelBuilder& FormulaModelBuilder::discrete() {
  discrete_ = true;
  return *this;
}
FormulaModelBuilder& FormulaModelBuilder::inputs_held(InputPath path) {
  at(at(model_, "time"), "inputs") = scalar(path == InputPath::constant ? "zoh"
                                            : path == InputPath::linear ? "foh"
                                                                        : "pchip");
  return *this;
}
FormulaModelBuilder& FormulaModelBuilder::step(double seconds) {
  set_step(model_, seconds);
  return *this;
}
FormulaModelBuilder& FormulaModelBuilder::name(const std::string& text) {
  at(model_, "name") = scalar(text);
  return *this;
}

FormulaModelBuilder::operator Model() const {
  YamlNode model = model_;
  at(at(model, "time"), "kind") = scalar(discrete_ ? "discrete" : "continuous");
  if (const YamlNode* states = find(model, "states")) {
    YamlNode& mean = at(at(model, "initial"), "mean");
    for (const YamlNode& state : std::vector<YamlNode>(states->items)) {
      if (find(mean, state.text) == nullptr) append(mean, state.text, scalar("0"));
    }
  }
  YamlNode& noise = at(model, "noise");
  if (find(noise, "process") != nullptr) {
    at(at(noise, "process"), "kind") = scalar(discrete_ ? "per-sample" : "density");
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
  append_new(at(model_, "outputs"), name, channel(name), "output");
  if (sd) {
    at(at(at(at(model_, "noise"), "measurement"), "sd"), name) =
        scalar(number_text(*sd, "the standard deviation of '" + name + "'"));
  }
  return *this;
}
VehicleModelBuilder& VehicleModelBuilder::sensor(const std::string& output,
                                                 const SensorPosition& position) {
  YamlNode node = mapping();
  append(node, "x", scalar(number_text(position.x, "x of a sensor")));
  append(node, "y", scalar(number_text(position.y, "y of a sensor")));
  append(node, "angle", scalar(number_text(position.angle, "the angle of a sensor")));
  append_new(at(model_, "sensors"), output, std::move(node), "sensor");
  return *this;
}
VehicleModelBuilder& VehicleModelBuilder::road_wheel_angle() {
  steering_ = "road_wheel_angle";
  return *this;
}
VehicleModelBuilder& VehicleModelBuilder::tyre(TyreCurve curve) {
  at(at(model_, "tyre"), "curve") = scalar(std::string(name_of(curve)));
  return *this;
}
VehicleModelBuilder& VehicleModelBuilder::min_speed(double metres_per_second) {
  at(model_, "use_when") =
      scalar(fmt::format("vx > {}", number_text(metres_per_second, "the least speed")));
  return *this;
}
VehicleModelBuilder& VehicleModelBuilder::name(const std::string& text) {
  at(model_, "name") = scalar(text);
  return *this;
}

VehicleModelBuilder::operator Model() const {
  YamlNode model = model_;
  append(model, "model", scalar("single-track"));
  append(at(model, "inputs"), steering_, channel(steering_));
  append(at(model, "inputs"), "vx", channel("vx"));
  return finished(std::move(model), "vehicle");
}

}  // namespace identikal
