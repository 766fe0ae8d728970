#include "identify/model/model_file.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <optional>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "identify/model/included_files.h"
#include "identify/model/internal/formula_form.h"
#include "identify/model/internal/linear_form.h"
#include "identify/model/internal/regression_form.h"
#include "identify/model/matrix_reader.h"
#include "identify/model/model_values.h"
#include "identify/model/yaml_reader.h"
#include "lib/base/nearest_name.h"
#include "lib/data/units.h"
#include "lib/vehicle/single_track.h"

namespace identikal {
namespace {

const std::vector<std::string> kCommonKeys = {"identikal",  "name",   "model",   "time",
                                              "parameters", "inputs", "outputs", "noise",
                                              "use_when",   "include"};
const std::vector<std::string> kLinearKeys = {"A", "B", "C", "D", "G", "Q", "R", "S", "initial"};
const std::vector<std::string> kVehicleKeys = {"sensors", "tyre"};
const std::vector<std::string> kRegressionKeys = {"regression"};
const std::vector<std::string> kFormulaKeys = {"states", "let", "dynamics"};

constexpr double kRequired = std::numeric_limits<double>::quiet_NaN();
constexpr ParameterRule kVehicleRules[] = {
    {"m", "kg", true, kRequired},
    {"a", "m", true, kRequired},
    {"b", "m", true, kRequired},
    {"Iz", "kg m^2", true, kRequired},
    {"Cf", "N/rad", true, kRequired},
    {"Cr", "N/rad", true, kRequired},
    {"steering_ratio", "", true, 1.0},
    {"steering_gain", "", false, 1.0, [](double x) { return x != 0.0; }, "a number other than 0"},
    {"steering_offset", "rad", false, 0.0},
    {"steering_delay", "s", false, 0.0, [](double x) { return std::abs(x) <= 1.0; },
     "between -1 s and 1 s"},
    {"bias_r", "rad/s", false, 0.0},
    {"bias_vy", "m/s", false, 0.0},
    {"bias_ay", "m/s^2", false, 0.0},
    {"mounting_angle", "rad", false, 0.0},
    {"bank", "rad", false, 0.0},
    {"relaxation_length", "m", false, 0.0, [](double x) { return x >= 0.0; }, "0 m or above"},
    {"cg_height", "m", false, 0.0, [](double x) { return x >= 0.0; }, "0 m or above"},
    {"load_sensitivity", "", false, 1.0, [](double x) { return x >= 0.0; }, "0 or above"},
};
// Of tyres that saturate: free where the file does not name them, about a friction of 1.
constexpr ParameterRule kCurveRules[] = {{"Ff_max", "N", true, kRequired},
                                         {"Fr_max", "N", true, kRequired}};
constexpr ParameterRule kMagicFormulaRules[] = {
    {"curve_shape", "", true, CurveShape().shape, [](double x) { return x >= 1.0 && x <= 2.0; },
     "between 1 and 2"},
    {"curve_curvature", "", false, CurveShape().curvature, [](double x) { return x < 1.0; },
     "below 1"}};

constexpr ChannelRule kVehicleInputs[] = {
    {"steering_wheel_angle", "rad"}, {"road_wheel_angle", "rad"}, {"vx", "m/s"}};
constexpr ChannelRule kVehicleOutputs[] = {
    {"r", "rad/s"}, {"vy", "m/s"}, {"ay", "m/s^2"}, {"beta", "rad"}};

/// The parameters of a car with tyres of this curve.
std::vector<ParameterRule> vehicle_rules(TyreCurve curve) {
  std::vector<ParameterRule> out(std::begin(kVehicleRules), std::end(kVehicleRules));
  if (curve != TyreCurve::linear) {
    out.insert(out.end(), std::begin(kCurveRules), std::end(kCurveRules));
  }
  if (curve == TyreCurve::magic_formula) {
    out.insert(out.end(), std::begin(kMagicFormulaRules), std::end(kMagicFormulaRules));
  }
  return out;
}

TimeSource read_time(const YamlNode& root, ModelFile::Form form, bool formulas) {
  const YamlNode& node =
      required(root, "time", "the model file", "time: {column: t, unit: s} or time: {step: 0.1 s}");
  std::vector<std::string> keys = {"kind", "step", "column", "unit", "runs"};
  if (form == ModelFile::Form::linear) keys.emplace_back("inputs");
  if (formulas) keys.insert(keys.end(), {"sampling", "integration_step"});
  check_keys(node, "time", keys);
  if (const YamlNode* kind = find(node, "kind")) {
    const bool continuous = word_of(*kind, "kind", {"discrete", "continuous"}) == "continuous";
    if (!continuous && form == ModelFile::Form::single_track) {
      throw InputError(kind->at, "kind is 'discrete'", "continuous: the vehicle's equations are");
    }
    if (continuous && form == ModelFile::Form::regression) {
      throw InputError(kind->at, "kind is 'continuous'", "discrete: a regression is over samples");
    }
  }
  TimeSource out;
  out.at = node.at;
  if (const YamlNode* unit = find(node, "unit")) {
    out.unit = text_of(*unit, "unit");
    si_value({1.0, out.unit}, "s", unit->at, "time");
  }
  if (const YamlNode* step = find(node, "step")) {
    out.step = read_si(*step, out.unit.empty() ? "s" : out.unit, "step");
    if (!(out.step > 0.0)) {
      throw InputError(step->at, "step is " + describe(*step), "a time above 0");
    }
  }
  if (const YamlNode* column = find(node, "column")) {
    out.column = text_of(*column, "column");
    out.at = column->at;
  }
  if (const YamlNode* runs = find(node, "runs")) {
    word_of(*runs, "runs", {"restart"});
    if (out.column.empty()) {
      throw InputError(runs->at, "runs without a column of time stamps", "column: NAME");
    }
    out.restarts = true;
  }
  if (out.column.empty() && out.step == 0.0) {
    throw InputError(node.at, "time has neither a column nor a step",
                     "column: NAME with the time stamps, or step: 0.1 s between rows");
  }
  return out;
}

/// The largest force of an axle that the file does not name: sought, from its load on a road with
/// a friction of 1.
Parameter unknown_peak(const ParameterRule& rule, const ParameterSet& others) {
  const auto value = [&](const char* name) {
    return others[static_cast<std::size_t>(find_parameter(others, name))].scalar();
  };
  const double weight = value("m") * kStandardGravity / (value("a") + value("b"));
  Parameter out;
  out.name = rule.name;
  out.unit = rule.si_unit;
  out.value = Eigen::MatrixXd::Constant(1, 1, weight * value(out.name == "Ff_max" ? "b" : "a"));
  out.min = 0.0;
  return out;
}

/// A prior of a logarithm has nothing at 0 and below, nor may the search go there.
void require_logarithm(const Parameter& parameter, const YamlNode& node) {
  const Prior::Kind kind = parameter.prior.kind;
  if (kind != Prior::Kind::log_uniform && kind != Prior::Kind::log_normal) return;
  for (const char* key : {"value", "min", "max"}) {
    const YamlNode* given = find(node, key);
    if (given == nullptr) continue;
    const std::string what = fmt::format("{} of parameter '{}'", key, parameter.name);
    if (read_si(*given, parameter.unit, what) > 0.0) continue;
    throw InputError(given->at, fmt::format("{} is {}", what, describe(*given)), "above 0",
                     "its prior is one of the logarithm");
  }
}

ParameterSet read_vehicle_parameters(const YamlNode& root, bool steering_at_road_wheel,
                                     TyreCurve curve) {
  const YamlNode& node =
      required(root, "parameters", "the model file", "parameters: m a b Iz Cf Cr steering_ratio");
  const std::vector<ParameterRule> rules = vehicle_rules(curve);
  for (const YamlNode& key : node.keys) {
    const auto is = [&key](const ParameterRule& rule) { return key.text == rule.name; };
    if (curve == TyreCurve::linear &&
        std::any_of(std::begin(kCurveRules), std::end(kCurveRules), is)) {
      throw InputError(key.at, in_quotes(key.text) + " belongs to tyres that saturate",
                       "tyre: {curve: tanh}, fiala or magic-formula");
    }
    if (curve != TyreCurve::magic_formula &&
        std::any_of(std::begin(kMagicFormulaRules), std::end(kMagicFormulaRules), is)) {
      throw InputError(key.at, in_quotes(key.text) + " belongs to the magic formula",
                       "tyre: {curve: magic-formula}");
    }
  }
  check_keys(node, "parameters", names_of(rules));
  if (const YamlNode* ratio = find(node, "steering_ratio"); ratio && steering_at_road_wheel) {
    throw InputError(ratio->at, "steering_ratio is given with the input road_wheel_angle",
                     "the input steering_wheel_angle, or no ratio");
  }
  if (!steering_at_road_wheel) {
    required(node, "steering_ratio", "parameters", "steering-wheel angle over road-wheel angle");
  }
  ParameterSet out;
  for (const ParameterRule& rule : rules) {
    if (const YamlNode* given = find(node, rule.name)) {
      out.push_back(read_parameter(rule.name, *given, &rule));
      require_logarithm(out.back(), *given);
      continue;
    }
    if (std::string_view(rule.name).ends_with("_max")) {
      out.push_back(unknown_peak(rule, out));
      continue;
    }
    if (std::isnan(rule.fallback)) {
      required(node, rule.name, "parameters",
               fmt::format("{}: NUMBER {}", rule.name, rule.si_unit));
    }
    Parameter known;
    known.name = rule.name;
    known.unit = rule.si_unit;
    known.value = Eigen::MatrixXd::Constant(1, 1, rule.fallback);
    known.fixed = true;
    out.push_back(std::move(known));
  }
  return out;
}

double read_min_speed(const YamlNode& node) {
  std::string_view rest = trimmed(text_of(node, "use_when"));
  for (const std::string_view sign : {"vx", ">"}) {
    rest = rest.starts_with(sign) ? trimmed(rest.substr(sign.size())) : "";
  }
  const std::optional<Quantity> speed = split_quantity(rest);
  if (!speed || !parse_unit(speed->unit)) {
    throw InputError(node.at, "use_when is " + describe(node), "'vx > 5' or 'vx > 18 km/h'",
                     "other conditions are not available yet");
  }
  const double value = si_value(*speed, "m/s", node.at, "use_when");
  if (!(value > 0.0)) throw InputError(node.at, "use_when is " + describe(node), "a speed above 0");
  return value;
}

void read_sensors(const YamlNode& root, ModelFile& out) {
  const YamlNode* node = find(root, "sensors");
  if (node == nullptr) return;
  check_keys(*node, "sensors", names_of(out.outputs));
  for (std::size_t i = 0; i < node->items.size(); ++i) {
    const YamlNode& item = node->items[i];
    check_keys(item, in_quotes(node->keys[i].text), {"x", "y", "angle"});
    SensorPosition& position = out.vehicle.sensors[node->keys[i].text];
    if (const YamlNode* x = find(item, "x")) position.x = read_si(*x, "m", "x");
    if (const YamlNode* y = find(item, "y")) position.y = read_si(*y, "m", "y");
    if (const YamlNode* angle = find(item, "angle")) {
      position.angle = read_si(*angle, "rad", "angle");
    }
  }
}

void read_measurement_noise(const YamlNode& root, ModelFile& out) {
  std::vector<double>& result = out.vehicle.measurement_sd;
  result.assign(out.outputs.size(), std::numeric_limits<double>::quiet_NaN());
  const YamlNode* node = find(root, "noise");
  if (node == nullptr) return;
  check_keys(*node, "noise", {"measurement"}, {"process"});
  const YamlNode& measurement = required(*node, "measurement", "noise", "measurement: {sd: ...}");
  check_keys(measurement, "measurement", {"kind", "sd"});
  if (const YamlNode* kind = find(measurement, "kind")) word_of(*kind, "kind", {"per-sample"});
  const YamlNode& sd = required(measurement, "sd", "measurement", "sd: {r: 0.01 rad/s}");
  check_keys(sd, "sd", names_of(out.outputs));
  for (std::size_t i = 0; i < out.outputs.size(); ++i) {
    const YamlNode* given = find(sd, out.outputs[i].name);
    if (given == nullptr) continue;
    const std::string what = "sd of " + out.outputs[i].name;
    result[i] = read_si(*given, out.outputs[i].si_unit, what);
    if (!(result[i] > 0.0)) {
      throw InputError(given->at, fmt::format("{} is {}", what, describe(*given)),
                       "a value above 0");
    }
  }
}

void read_vehicle(const YamlNode& root, ModelFile& out) {
  const std::string top = "the model file";
  const std::string inputs_example =
      "inputs: {steering_wheel_angle: {column: ..., unit: deg}, vx: {column: ..., unit: m/s}}";
  const YamlNode& inputs = required(root, "inputs", top, inputs_example);
  out.inputs = read_channels(inputs, "inputs", kVehicleInputs);
  std::sort(out.inputs.begin(), out.inputs.end(), [](const auto& one, const auto& other) {
    return one.name != "vx" && other.name == "vx";
  });
  if (out.inputs.size() != 2 || out.inputs[1].name != "vx") {
    throw InputError(inputs.at, "inputs are not one steering angle and vx",
                     "one of steering_wheel_angle and road_wheel_angle, and vx");
  }
  VehicleSettings& vehicle = out.vehicle;
  vehicle.steering_at_road_wheel = out.inputs[0].name == "road_wheel_angle";
  out.outputs =
      read_channels(required(root, "outputs", top, "outputs: {r: {column: ..., unit: deg/s}}"),
                    "outputs", kVehicleOutputs);
  if (const YamlNode* tyre = find(root, "tyre")) {
    check_keys(*tyre, "tyre", {"curve"});
    const YamlNode& curve = required(*tyre, "curve", "tyre", "curve: linear");
    vehicle.curve =
        *tyre_curve(word_of(curve, "curve", {"linear", "tanh", "fiala", "magic-formula"}));
  }
  out.parameters = read_vehicle_parameters(root, vehicle.steering_at_road_wheel, vehicle.curve);

  read_sensors(root, out);
  read_measurement_noise(root, out);
  if (const YamlNode* use_when = find(root, "use_when")) {
    vehicle.min_speed = read_min_speed(*use_when);
  }
  out.regression = read_regression_settings(root, out.form);
}

// Throws at the first key that models of this form do not have.
void refuse_foreign_keys(const YamlNode& root, ModelFile::Form form) {
  const auto refuse = [&root](const std::vector<std::string>& keys, const char* what) {
    for (const std::string& key : keys) {
      if (find(root, key) == nullptr) continue;
      const auto at = std::find_if(root.keys.begin(), root.keys.end(),
                                   [&](const YamlNode& k) { return k.text == key; });
      throw InputError(at->at, fmt::format("'{}' {}", key, what));
    }
  };
  if (form == ModelFile::Form::linear) {
    refuse(kVehicleKeys, "belongs to model: single-track");
    refuse(kRegressionKeys, "belongs to model: regression");
    if (find(root, "dynamics") != nullptr || find(root, "states") != nullptr) {
      refuse({"A", "B", "C", "D"}, "stands beside formulas, which say the same");
    } else {
      refuse({"let", "use_when"}, "belongs to a model with dynamics");
    }
  } else if (form == ModelFile::Form::single_track) {
    refuse(kLinearKeys, "does not belong to model: single-track");
    refuse(kFormulaKeys, "does not belong to model: single-track");
  } else {
    refuse(kLinearKeys, "does not belong to model: regression");
    refuse(kVehicleKeys, "does not belong to model: regression");
    refuse(kFormulaKeys, "does not belong to model: regression");
    refuse({"parameters", "noise", "use_when"}, "does not belong to model: regression");
  }
}

}  // namespace

const char* to_string(NonlinearMethod method) {
  switch (method) {
    case NonlinearMethod::extended:
      return "extended";
    case NonlinearMethod::iterated:
      return "iterated";
    case NonlinearMethod::unscented:
      return "unscented";
  }
  return "";
}

NonlinearMethod nonlinear_method(const std::string& name, const Location& at) {
  for (const NonlinearMethod method :
       {NonlinearMethod::extended, NonlinearMethod::iterated, NonlinearMethod::unscented}) {
    if (name == to_string(method)) return method;
  }
  throw InputError(at, fmt::format("unknown filter '{}'", name), "extended, iterated or unscented");
}

ModelFile read_model_file(const std::string& path) {
  return parse_model_file(read_yaml_text(path), path);
}

ModelFile parse_model_file(const std::string& text, const std::string& path) {
  const YamlNode root = parse_with_included(text, path);
  const std::string top = "the model file";
  std::vector<std::string> keys = kCommonKeys;
  keys.insert(keys.end(), kLinearKeys.begin(), kLinearKeys.end());
  keys.insert(keys.end(), kVehicleKeys.begin(), kVehicleKeys.end());
  keys.insert(keys.end(), kRegressionKeys.begin(), kRegressionKeys.end());
  keys.insert(keys.end(), kFormulaKeys.begin(), kFormulaKeys.end());
  check_keys(root, top, keys);
  word_of(required(root, "identikal", top, "identikal: 1, the version of the format"), "identikal",
          {"1"});

  ModelFile out;
  out.path = path;
  const YamlNode* name = find(root, "name");
  out.name = name == nullptr ? std::filesystem::path(path).stem().string() : text_of(*name, "name");
  if (const YamlNode* model = find(root, "model")) {
    const bool vehicle = word_of(*model, "model", {"single-track", "regression"}) == "single-track";
    out.form = vehicle ? ModelFile::Form::single_track : ModelFile::Form::regression;
  }
  refuse_foreign_keys(root, out.form);
  const bool formulas = find(root, "dynamics") != nullptr || find(root, "states") != nullptr;
  out.time = read_time(root, out.form, formulas);
  if (formulas) {
    read_formulas(root, out);
  } else if (out.form == ModelFile::Form::linear) {
    read_linear(root, out);
  } else if (out.form == ModelFile::Form::single_track) {
    read_vehicle(root, out);
  } else {
    read_regression(root, out);
  }
  return out;
}

std::string vehicle_unit(const std::string& parameter) {
  for (const ParameterRule& rule : vehicle_rules(TyreCurve::magic_formula)) {
    if (parameter == rule.name) return rule.si_unit;
  }
  return "";
}

void set_parameter(ModelFile& model, const std::string& assignment) {
  const std::size_t equals = assignment.find('=');
  const std::string what = in_quotes(assignment);
  if (equals == std::string::npos) throw InputError({}, what, "NAME=VALUE");
  const std::string name(trimmed(std::string_view(assignment).substr(0, equals)));
  const std::string text(trimmed(std::string_view(assignment).substr(equals + 1)));
  if (name.empty()) throw InputError({}, what, "NAME=VALUE");
  const int index = find_parameter(model.parameters, name);
  if (index < 0) {
    std::vector<std::string> known;
    for (const Parameter& parameter : model.parameters) known.push_back(parameter.name);
    throw InputError({}, fmt::format("{}: the model has no parameter {}", what, in_quotes(name)),
                     "", did_you_mean(name, known));
  }
  if (name == "steering_ratio" && model.vehicle.steering_at_road_wheel) {
    throw InputError({}, what + ": the input road_wheel_angle makes no use of it");
  }
  Parameter changed = model.parameters[static_cast<std::size_t>(index)];
  if (changed.value.size() != 1 && changed.domain != Domain::scaled_identity) {
    throw InputError({}, fmt::format("{}: {} is a matrix", what, name), "",
                     "change its start in the model file");
  }
  const double value = si_value(parse_quantity(text, {}, what), changed.unit, {}, what);
  changed.value = value * Eigen::MatrixXd::Identity(changed.value.rows(), changed.value.cols());
  if (changed.domain == Domain::scalar) {
    const bool vehicle = model.form == ModelFile::Form::single_track;
    const std::vector<ParameterRule> rules = vehicle_rules(model.vehicle.curve);
    const auto rule = std::find_if(rules.begin(), rules.end(),
                                   [&](const ParameterRule& each) { return each.name == name; });
    check_value(changed, vehicle && rule != rules.end() ? &*rule : nullptr, {});
  } else if (const std::string fault = domain_fault(changed); !fault.empty()) {
    throw InputError({}, fmt::format("{}: the matrix {}", what, fault));
  }
  ParameterSet parameters = model.parameters;
  parameters[static_cast<std::size_t>(index)] = std::move(changed);
  if (model.form == ModelFile::Form::linear || model.form == ModelFile::Form::nonlinear) {
    if (const std::optional<ModelFault> fault = fault_at(model.linear, parameters)) {
      throw InputError({}, fmt::format("{}: {} then", what, fault->text));
    }
  }
  model.parameters = std::move(parameters);
}

}  // namespace identikal
