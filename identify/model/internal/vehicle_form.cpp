#include "identify/model/internal/vehicle_form.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "identify/model/internal/regression_form.h"
#include "lib/base/constants.h"
#include "lib/data/units.h"
#include "lib/vehicle/sensor.h"
#include "lib/vehicle/single_track.h"

namespace identikal {
namespace {

constexpr double kRequired = kNaN;
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

// Of every sensor, in the order of SensorProperty; known as neutral where the file is silent.
constexpr ParameterRule kSensorRules[kSensorProperties] = {
    {"gain", "", true, 1.0},
    {"delay", "s", false, 0.0, [](double x) { return std::abs(x) <= 1.0; }, "between -1 s and 1 s"},
    {"lag", "s", false, 0.0, [](double x) { return x >= 0.0 && x <= 1.0; }, "between 0 s and 1 s"},
    {"x", "m", false, 0.0},
    {"y", "m", false, 0.0},
    {"angle", "rad", false, 0.0}};

constexpr ChannelRule kVehicleInputs[] = {
    {"steering_wheel_angle", "rad"}, {"road_wheel_angle", "rad"}, {"vx", "m/s"}};
constexpr ChannelRule kVehicleOutputs[] = {
    {"r", "rad/s"}, {"vy", "m/s"}, {"ay", "m/s^2"}, {"beta", "rad"}};

/// The parameters of the car itself, without those of its sensors.
std::vector<ParameterRule> car_rules(TyreCurve curve) {
  std::vector<ParameterRule> out(std::begin(kVehicleRules), std::end(kVehicleRules));
  if (curve != TyreCurve::linear) {
    out.insert(out.end(), std::begin(kCurveRules), std::end(kCurveRules));
  }
  if (curve == TyreCurve::magic_formula) {
    out.insert(out.end(), std::begin(kMagicFormulaRules), std::end(kMagicFormulaRules));
  }
  return out;
}

/// The rule of a property, by the name that the parameter has among the others: "delay_r".
ParameterRule sensor_rule(VehicleQuantity quantity, SensorProperty property) {
  ParameterRule out = kSensorRules[static_cast<int>(property)];
  out.name = name_of(sensor_parameter(quantity, property)).data();
  return out;
}

/// The largest force of an axle that the file does not name: estimated, from its load on a road
/// with a friction of 1.
Parameter unknown_peak(const ParameterRule& rule, const ParameterSet& others) {
  const auto value = [&](const char* name) {
    return others[find_parameter(others, name)].scalar();
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
  const std::vector<ParameterRule> rules = car_rules(curve);
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

/// One property of a sensor. A place or an angle that is a plain number is where the sensor is;
/// all else is a parameter, "x_ay".
void read_sensor_property(const YamlNode& node, VehicleQuantity quantity, SensorProperty property,
                          SensorPosition& position, ParameterSet& parameters) {
  const bool plain = node.kind == YamlNode::Kind::scalar;
  const std::string key = kSensorRules[static_cast<int>(property)].name;
  const std::string unit = kSensorRules[static_cast<int>(property)].si_unit;
  if (plain && property == SensorProperty::x) position.x = read_si(node, unit, key);
  if (plain && property == SensorProperty::y) position.y = read_si(node, unit, key);
  if (plain && property == SensorProperty::angle) position.angle = read_si(node, unit, key);
  const bool place = property >= SensorProperty::x;
  if (plain && place) return;
  const ParameterRule rule = sensor_rule(quantity, property);
  if (place && quantity == VehicleQuantity::r) {
    throw InputError(node.at, "'" + key + "' of the yaw rate's sensor is to be fitted", "",
                     "a body turns at the same rate everywhere; free its gain, delay or lag");
  }
  parameters.push_back(read_parameter(rule.name, node, &rule));
  require_logarithm(parameters.back(), node);
}

void read_sensors(const YamlNode& root, Model& out) {
  const YamlNode* node = find(root, "sensors");
  if (node == nullptr) return;
  check_keys(*node, "sensors", names_of(out.outputs));
  for (std::size_t i = 0; i < node->items.size(); ++i) {
    const YamlNode& item = node->items[i];
    const std::string& output = node->keys[i].text;
    check_keys(item, in_quotes(output), names_of(kSensorRules));
    SensorPosition& position = as_vehicle(out).sensors[output];
    for (int k = 0; k < kSensorProperties; ++k) {
      const YamlNode* given = find(item, kSensorRules[k].name);
      if (given == nullptr) continue;
      read_sensor_property(*given, *vehicle_quantity(output), static_cast<SensorProperty>(k),
                           position, out.parameters);
    }
  }
}

void read_measurement_noise(const YamlNode& root, Model& out) {
  std::vector<double>& result = as_vehicle(out).measurement_sd;
  result.assign(out.outputs.size(), kNaN);
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

}  // namespace

std::vector<ParameterRule> vehicle_rules(TyreCurve curve) {
  std::vector<ParameterRule> out = car_rules(curve);
  for (int i = kFirstOfSensors; i < kVehicleParameters; ++i) {
    const auto parameter = static_cast<VehicleParameter>(i);
    out.push_back(sensor_rule(quantity_of(parameter), property_of(parameter)));
  }
  return out;
}

void read_vehicle(const YamlNode& root, Model& out) {
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
  VehicleModel& vehicle = as_vehicle(out);
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
  vehicle.tracking = read_tracking(root);
}

std::string vehicle_unit(const std::string& parameter) {
  for (const ParameterRule& rule : vehicle_rules(TyreCurve::magic_formula)) {
    if (parameter == rule.name) return rule.si_unit;
  }
  return "";
}

}  // namespace identikal
