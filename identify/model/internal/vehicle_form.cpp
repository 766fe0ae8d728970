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
    {"steering_lag", "s", false, 0.0, [](double x) { return x >= 0.0 && x <= 1.0; },
     "between 0 s and 1 s"},
    {"bias_r", "rad/s", false, 0.0},
    {"bias_vy", "m/s", false, 0.0},
    {"bias_ay", "m/s^2", false, 0.0},
    {"mounting_angle", "rad", false, 0.0},
    {"bank", "rad", false, 0.0},
    {"relaxation_length", "m", false, 0.0, [](double x) { return x >= 0.0; }, "0 m or above"},
    {"cg_height", "m", false, 0.0, [](double x) { return x >= 0.0; }, "0 m or above"},
    {"load_sensitivity", "", false, 1.0, [](double x) { return x >= 0.0; }, "0 or above"},
};
// None where the file does not name it.
constexpr ParameterRule kComplianceRule = {
    "steering_compliance", "rad/N", false, 0.0, [](double x) { return x >= 0.0; },
    "0 rad/N or above"};
// Of load that turning moves across the car; the transfers follow from the keys of `load_transfer`.
const ParameterRule kDegressionRule = {
    "degression",        "", false, kRequired, [](double x) { return x >= 0.0 && x <= 0.95; },
    "between 0 and 0.95"};
const ParameterRule kTransferRules[] = {{"load_transfer_front", "s^2/m", false, 0.0},
                                        {"load_transfer_rear", "s^2/m", false, 0.0}};
// Of tyres that saturate: free where the file does not name them, about a friction of 1.
constexpr ParameterRule kCurveRules[] = {{"Ff_max", "N", true, kRequired},
                                         {"Fr_max", "N", true, kRequired}};
constexpr ParameterRule kMagicFormulaRules[] = {
    {"curve_shape", "", true, CurveShape().shape, [](double x) { return x >= 1.0 && x <= 2.0; },
     "between 1 and 2"},
    {"curve_curvature", "", false, CurveShape().curvature, [](double x) { return x < 1.0; },
     "below 1"}};

// Of a body that rolls; keys of `roll`, {front, rear} of each axle.
struct RollRule {
  const char *key, *axle;
  VehicleParameter parameter;
  ParameterRule rule;
};
constexpr double kArmOverWheelbase = 0.17;  // what passenger cars have
const RollRule kRollRules[] = {
    {"gradient",
     "",
     kRollPerAcceleration,
     {"roll_gradient", "rad/(m/s^2)", false, kRequired,
      [](double x) { return x >= 0.0 && x <= 0.1; }, "between 0 and 0.1 rad/(m/s^2)"}},
    {"height",
     "",
     kRollHeight,
     {"roll_height", "m", false, 0.0, [](double x) { return x >= 0.0; }, "0 m or above"}},
    {"frequency", "", kRollFrequency, {"roll_frequency", "Hz", true, 1.5}},
    {"damping", "", kRollDamping, {"roll_damping", "", true, 0.35}},
    {"steer", "front", kFrontSteerPerRoll, {"roll_steer_front", "", false, 0.0}},
    {"steer", "rear", kRearSteerPerRoll, {"roll_steer_rear", "", false, 0.0}},
    {"camber", "front", kFrontCamberPerRoll, {"roll_camber_front", "N/rad", false, 0.0}},
    {"camber", "rear", kRearCamberPerRoll, {"roll_camber_rear", "N/rad", false, 0.0}}};

// Of every sensor, in the order of SensorProperty; known as neutral where the file is silent.
constexpr ParameterRule kSensorRules[kSensorProperties] = {
    {"gain", "", true, 1.0},
    {"delay", "s", false, 0.0, [](double x) { return std::abs(x) <= 1.0; }, "between -1 s and 1 s"},
    {"lag", "s", false, 0.0, [](double x) { return x >= 0.0 && x <= 1.0; }, "between 0 s and 1 s"},
    {"x", "m", false, 0.0},
    {"y", "m", false, 0.0},
    {"angle", "rad", false, 0.0}};

constexpr ChannelRule kVehicleInputs[] = {
    {"steering_wheel_angle", "rad"}, {"road_wheel_angle", "rad"}, {"vx", "m/s"}, {"roll", "rad"}};
constexpr ChannelRule kVehicleOutputs[] = {
    {"r", "rad/s"}, {"vy", "m/s"}, {"ay", "m/s^2"}, {"beta", "rad"}};

/// The parameters of the car itself, without those of its sensors.
std::vector<ParameterRule> car_rules(TyreCurve curve) {
  std::vector<ParameterRule> out(std::begin(kVehicleRules), std::end(kVehicleRules));
  out.push_back(kComplianceRule);
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

double known_value(const ParameterSet& parameters, const char* name) {
  return parameters[find_parameter(parameters, name)].scalar();
}

Parameter known_parameter(const ParameterRule& rule, double value) {
  Parameter out;
  out.name = rule.name;
  out.unit = rule.si_unit;
  out.value = Eigen::MatrixXd::Constant(1, 1, value);
  out.fixed = true;
  return out;
}

/// The largest force of an axle that the file does not name: estimated, from its load on a road
/// with a friction of 1.
Parameter unknown_peak(const ParameterRule& rule, const ParameterSet& others) {
  const double weight = known_value(others, "m") * kStandardGravity /
                        (known_value(others, "a") + known_value(others, "b"));
  Parameter out;
  out.name = rule.name;
  out.unit = rule.si_unit;
  out.value = Eigen::MatrixXd::Constant(
      1, 1, weight * known_value(others, out.name == "Ff_max" ? "b" : "a"));
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
    if (rule.name == std::string_view(kComplianceRule.name)) continue;
    if (std::string_view(rule.name).ends_with("_max")) {
      out.push_back(unknown_peak(rule, out));
      continue;
    }
    if (std::isnan(rule.fallback)) {
      required(node, rule.name, "parameters",
               fmt::format("{}: NUMBER {}", rule.name, rule.si_unit));
    }
    out.push_back(known_parameter(rule, rule.fallback));
  }
  return out;
}

/// What its sensor does to the steering angle, in the unit of its column: "steps" or "noise".
double read_of_steering(const YamlNode& inputs, const Model& model, const std::string& key) {
  double out = 0.0;
  for (std::size_t i = 0; i < inputs.items.size(); ++i) {
    const YamlNode* given = find(inputs.items[i], key);
    if (given == nullptr) continue;
    const ChannelSource& input = model.inputs[i];
    if (input.name == "vx" || input.name == "roll") {
      throw InputError(given->at, key + " of " + input.name, "of the steering angle alone");
    }
    const double value = read_si(*given, input.unit.empty() ? "rad" : input.unit, key);
    if (!(value > 0.0)) throw InputError(given->at, key + " is " + describe(*given), "above 0");
    out = std::abs(input.scale) * value;
  }
  return out;
}

/// "vx > 5", "vx > 18 km/h": nothing where it is another condition.
std::optional<double> read_min_speed(const YamlNode& node) {
  std::string_view rest = trimmed(text_of(node, "use_when"));
  for (const std::string_view sign : {"vx", ">"}) {
    rest = rest.starts_with(sign) ? trimmed(rest.substr(sign.size())) : "";
  }
  const std::optional<Quantity> speed = split_quantity(rest);
  if (!speed || !parse_unit(speed->unit)) return std::nullopt;
  const double value = si_value(*speed, "m/s", node.at, "use_when");
  if (!(value > 0.0)) throw InputError(node.at, "use_when is " + describe(node), "a speed above 0");
  return value;
}

double read_duration(const YamlNode& node, const char* key) {
  const double value = read_si(node, "s", fmt::format("{} of use_when", key));
  if (value >= 0.0 && value <= 10.0) return value;
  throw InputError(node.at, fmt::format("{} of use_when is {}", key, describe(node)),
                   "between 0 s and 10 s");
}

Expression read_condition(const YamlNode& node, const Model& model) {
  std::vector<std::string> names = names_of(model.inputs);
  for (const ChannelSource& output : model.outputs) names.push_back(output.name);
  try {
    return parse_expression(text_of(node, "use_when"), names, FormulaKind::condition);
  } catch (const FormulaError& error) {
    throw InputError(node.at, fmt::format("use_when is {}: {}", describe(node), error.what()));
  }
}

/// A condition, or {condition, bridge, margin}.
void read_use_when(const YamlNode& root, Model& out) {
  const YamlNode* node = find(root, "use_when");
  if (node == nullptr) return;
  const bool plain = node->kind == YamlNode::Kind::scalar;
  if (!plain) check_keys(*node, "use_when", {"condition", "bridge", "margin"});
  const YamlNode& condition =
      plain ? *node : required(*node, "condition", "use_when", "condition: 'vx > 5'");
  VehicleModel& vehicle = as_vehicle(out);
  if (plain) {
    if (const std::optional<double> speed = read_min_speed(condition)) {
      vehicle.min_speed = *speed;
      return;
    }
  }
  RowCondition rows{read_condition(condition, out)};
  if (!plain) {
    if (const YamlNode* bridge = find(*node, "bridge"))
      rows.bridge = read_duration(*bridge, "bridge");
    if (const YamlNode* margin = find(*node, "margin"))
      rows.margin = read_duration(*margin, "margin");
  }
  vehicle.use_when = std::move(rows);
}

/// How long a gap may be for the simulation to go on across it.
void read_max_gap(const YamlNode& root, VehicleModel& out) {
  const YamlNode* node = find(root, "max_gap");
  if (node == nullptr) return;
  out.max_gap = read_si(*node, "s", "max_gap");
  if (out.max_gap >= 0.0 && out.max_gap <= 1.0) return;
  throw InputError(node->at, "max_gap is " + describe(*node), "between 0 s and 1 s");
}

/// Columns that use_when may ask beside the inputs and outputs.
void read_flags(const YamlNode& root, Model& out) {
  const YamlNode* node = find(root, "flags");
  if (node == nullptr) return;
  for (ChannelSource& flag : read_channels(*node, "flags", {})) {
    const auto same = [&](const ChannelSource& other) { return other.name == flag.name; };
    if (std::any_of(out.inputs.begin(), out.inputs.end(), same) ||
        std::any_of(out.outputs.begin(), out.outputs.end(), same)) {
      throw InputError(flag.at, "flag " + in_quotes(flag.name) + " is a channel already",
                       "another name");
    }
    out.inputs.push_back(std::move(flag));
  }
}

/// The gradient m h / (K - m g h) of a body that springs of stiffness K [N m/rad] hold upright.
Parameter gradient_of_stiffness(const YamlNode& node, const ParameterRule& rule,
                                const ParameterSet& parameters) {
  const double moment = known_value(parameters, "m") * known_value(parameters, "roll_height");
  const double stiffness = read_si(node, "N m/rad", "stiffness of roll");
  const double tilting = kStandardGravity * moment;
  if (!(stiffness > tilting)) {
    throw InputError(
        node.at, "stiffness of roll is " + describe(node),
        fmt::format("above m g height = {:.4g} N m/rad, or the body falls over", tilting));
  }
  return known_parameter(rule, moment / (stiffness - tilting));
}

/// The value of a rule in `roll`, if the file has it.
const YamlNode* find_in_roll(const YamlNode& roll, const RollRule& rule) {
  const YamlNode* node = find(roll, rule.key);
  return node == nullptr || *rule.axle == '\0' ? node : find(*node, rule.axle);
}

void check_roll_keys(const YamlNode& node, bool measured) {
  check_keys(node, "roll",
             {"gradient", "stiffness", "height", "frequency", "damping", "steer", "camber"});
  for (const char* key : {"gradient", "stiffness", "frequency", "damping"}) {
    const YamlNode* given = find(node, key);
    if (given == nullptr || !measured) continue;
    throw InputError(given->at, fmt::format("roll has a {}, and is measured (inputs)", key),
                     "one of them");
  }
  for (const char* key : {"steer", "camber"}) {
    if (const YamlNode* axles = find(node, key)) {
      check_keys(*axles, fmt::format("{} of roll", key), {"front", "rear"});
    }
  }
  const YamlNode *stiffness = find(node, "stiffness"), *gradient = find(node, "gradient");
  if (stiffness != nullptr && gradient != nullptr) {
    throw InputError(stiffness->at, "roll has a gradient and a stiffness", "one of them");
  }
  if (!measured && stiffness == nullptr && gradient == nullptr) {
    throw InputError(node.at, "roll has neither a gradient nor a stiffness",
                     "gradient: {value: 0.008 rad/(m/s^2), min: 0, max: 0.03}");
  }
}

/// Adds the parameters of a body that rolls, where the file has one.
void read_roll(const YamlNode& root, bool measured, ParameterSet& parameters) {
  const YamlNode* node = find(root, "roll");
  if (node == nullptr) return;
  check_roll_keys(*node, measured);
  const double wheelbase = known_value(parameters, "a") + known_value(parameters, "b");
  const YamlNode* stiffness = find(*node, "stiffness");
  std::optional<RollRule> by_stiffness;
  for (const RollRule& each : kRollRules) {
    const bool gradient = each.parameter == kRollPerAcceleration;
    if (measured &&
        (gradient || each.parameter == kRollFrequency || each.parameter == kRollDamping)) {
      continue;
    }
    if (gradient && stiffness != nullptr) {
      by_stiffness = each;  // it needs the height
    } else if (const YamlNode* given = find_in_roll(*node, each)) {
      parameters.push_back(read_parameter(each.rule.name, *given, &each.rule));
      require_logarithm(parameters.back(), *given);
    } else {
      const bool height = each.parameter == kRollHeight;
      parameters.push_back(
          known_parameter(each.rule, height ? kArmOverWheelbase * wheelbase : each.rule.fallback));
    }
  }
  if (by_stiffness) {
    parameters.push_back(gradient_of_stiffness(*stiffness, by_stiffness->rule, parameters));
  }
}

/// Adds what the load that turning moves across the car takes from the stiffnesses, where the file
/// says so.
void read_load_transfer(const YamlNode& root, ParameterSet& parameters) {
  const YamlNode* node = find(root, "load_transfer");
  if (node == nullptr) return;
  check_keys(*node, "load_transfer", {"height", "track", "front_share", "degression"});
  const std::string example = "{height: 0.5 m, track: 1.5 m, degression: 0.3}";
  const auto size = [&](const char* key) {
    const YamlNode& given = required(*node, key, "load_transfer", example);
    const double value = read_si(given, "m", fmt::format("{} of load_transfer", key));
    if (value > 0.0) return value;
    throw InputError(given.at, fmt::format("{} of load_transfer is {}", key, describe(given)),
                     "above 0 m");
  };
  const double a = known_value(parameters, "a"), b = known_value(parameters, "b");
  const double per_share = 2.0 * size("height") * (a + b) / (kStandardGravity * size("track"));
  double front = b / (a + b);
  if (const YamlNode* given = find(*node, "front_share")) {
    front = read_si(*given, "", "front_share of load_transfer");
    if (!(front >= 0.0 && front <= 1.0)) {
      throw InputError(given->at, "front_share of load_transfer is " + describe(*given),
                       "between 0 and 1");
    }
  }
  const YamlNode& degression = required(*node, "degression", "load_transfer", example);
  parameters.push_back(read_parameter(kDegressionRule.name, degression, &kDegressionRule));
  require_logarithm(parameters.back(), degression);
  parameters.push_back(known_parameter(kTransferRules[0], per_share * front / b));
  parameters.push_back(known_parameter(kTransferRules[1], per_share * (1.0 - front) / a));
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
  for (const RollRule& each : kRollRules) out.push_back(each.rule);
  out.push_back(kDegressionRule);
  out.insert(out.end(), std::begin(kTransferRules), std::end(kTransferRules));
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
  out.inputs = read_channels(inputs, "inputs", kVehicleInputs, {"steps", "noise"});
  as_vehicle(out).steering_steps = read_of_steering(inputs, out, "steps");
  as_vehicle(out).steering_noise = read_of_steering(inputs, out, "noise");
  const auto place = [](const ChannelSource& input) {
    return input.name == "roll" ? 2 : input.name == "vx" ? 1 : 0;
  };
  std::stable_sort(out.inputs.begin(), out.inputs.end(),
                   [&](const auto& one, const auto& other) { return place(one) < place(other); });
  const std::size_t count = out.inputs.size();
  if (count < 2 || count > 3 || place(out.inputs[0]) != 0 || place(out.inputs[1]) != 1 ||
      (count == 3 && place(out.inputs[2]) != 2)) {
    throw InputError(inputs.at, "inputs are not one steering angle and vx",
                     "one of steering_wheel_angle and road_wheel_angle, and vx; roll beside them "
                     "where it is measured");
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
  if (const YamlNode* axle = find(root, "driven_axle")) {
    const std::string& word = word_of(*axle, "driven_axle", {"front", "rear", "both"});
    vehicle.front_drive = word == "front" ? 1.0 : word == "rear" ? 0.0 : 0.5;
  }
  out.parameters = read_vehicle_parameters(root, vehicle.steering_at_road_wheel, vehicle.curve);

  read_flags(root, out);
  read_use_when(root, out);
  read_max_gap(root, vehicle);
  read_roll(root, count == 3, out.parameters);
  read_load_transfer(root, out.parameters);
  read_sensors(root, out);
  read_measurement_noise(root, out);
  vehicle.tracking = read_tracking(root);
}

bool has_measured_roll(const Model& model) {
  return model.inputs.size() > 2 && model.inputs[2].name == "roll";
}

std::string vehicle_unit(const std::string& parameter) {
  for (const ParameterRule& rule : vehicle_rules(TyreCurve::magic_formula)) {
    if (parameter == rule.name) return rule.si_unit;
  }
  return "";
}

}  // namespace identikal
