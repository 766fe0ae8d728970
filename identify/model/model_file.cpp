#include "identify/model/model_file.h"

#include <algorithm>
#include <filesystem>
#include <optional>
#include <string_view>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "identify/model/components.h"
#include "identify/model/curves.h"
#include "identify/model/included_files.h"
#include "identify/model/internal/constraint_form.h"
#include "identify/model/internal/formula_form.h"
#include "identify/model/internal/linear_form.h"
#include "identify/model/internal/regression_form.h"
#include "identify/model/internal/static_form.h"
#include "identify/model/internal/vehicle_form.h"
#include "identify/model/matrix_reader.h"
#include "identify/model/model_values.h"
#include "identify/model/own_parameters.h"
#include "identify/model/sensors.h"
#include "identify/model/yaml_reader.h"
#include "lib/base/nearest_name.h"
#include "lib/data/units.h"

namespace identikal {
namespace {

const std::vector<std::string> kCommonKeys = {
    "identikal", "name",     "model",     "time",    "parameters", "inputs",  "outputs",
    "noise",     "use_when", "reference", "include", "recordings", "spreads", "constraints"};
const std::vector<std::string> kLinearKeys = {"A", "B", "C", "D", "G", "Q", "R", "S", "initial"};
const std::vector<std::string> kVehicleKeys = {"driven_axle", "flags",   "load_transfer", "max_gap",
                                               "roll",        "sensors", "tyre"};
const std::vector<std::string> kRegressionKeys = {"regression"};
const std::vector<std::string> kFormulaKeys = {"states", "let", "dynamics", "doses"};

// Of the model, its form alone is known.
TimeSource read_time(const YamlNode& root, const Model& model, bool formulas) {
  const YamlNode& node =
      required(root, "time", "the model file", "time: {column: t, unit: s} or time: {step: 0.1 s}");
  std::vector<std::string> keys = {"kind", "step", "column", "unit", "runs"};
  if (is_linear(model)) keys.insert(keys.end(), {"inputs", "sampling"});
  if (formulas) {
    keys.insert(keys.end(), {"integration_step", "integration_tolerance", "infinity"});
  }
  check_keys(node, "time", keys);
  if (const YamlNode* kind = find(node, "kind")) {
    const bool continuous = word_of(*kind, "kind", {"discrete", "continuous"}) == "continuous";
    if (!continuous && is_vehicle(model)) {
      throw InputError(kind->at, "kind is 'discrete'", "continuous: the vehicle's equations are");
    }
    if (continuous && is_regression(model)) {
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
  out.infinite = find(node, "infinity") != nullptr;
  if (out.column.empty() && out.step == 0.0) {
    throw InputError(node.at, "time has neither a column nor a step",
                     "column: NAME with the time stamps, or step: 0.1 s between rows");
  }
  return out;
}

// Throws at the first key that models of this form do not have.
void refuse_foreign_keys(const YamlNode& root, const Model& model) {
  const auto refuse = [&root](const std::vector<std::string>& keys, const char* what) {
    for (const std::string& key : keys) {
      if (find(root, key) == nullptr) continue;
      const auto at = std::find_if(root.keys.begin(), root.keys.end(),
                                   [&](const YamlNode& k) { return k.text == key; });
      throw InputError(at->at, fmt::format("'{}' {}", key, what));
    }
  };
  if (is_linear(model)) {
    refuse({"driven_axle", "load_transfer", "max_gap", "roll", "tyre"},
           "belongs to model: single-track");  // flags are both's
    refuse({"sensors"}, "belongs to models of formulas and to model: single-track");
    refuse(kRegressionKeys, "belongs to model: regression");
    if (find(root, "dynamics") != nullptr || find(root, "states") != nullptr) {
      refuse({"A", "B", "C", "D"}, "is a duplicate of the formulas");
    } else {
      refuse({"let", "use_when", "doses"}, "belongs to a model with dynamics");
    }
  } else if (is_vehicle(model)) {
    refuse(kLinearKeys, "does not belong to model: single-track");
    refuse(kFormulaKeys, "does not belong to model: single-track");
    refuse({"reference"}, "does not belong to model: single-track, which has no filter");
    refuse({"recordings", "spreads"}, "does not belong to model: single-track");
  } else {
    refuse(kLinearKeys, "does not belong to model: regression");
    refuse(kVehicleKeys, "does not belong to model: regression");
    refuse(kFormulaKeys, "does not belong to model: regression");
    refuse({"parameters", "noise", "use_when", "reference", "recordings", "spreads", "constraints"},
           "does not belong to model: regression");
  }
}

}  // namespace

Model read_model_file(const std::string& path) {
  return parse_model_file(read_yaml_text(path), path);
}

Model parse_model_file(const std::string& text, const std::string& path, FormulaReading reading) {
  return model_of(parse_with_included(text, path), path, reading);
}

Model model_of(const YamlNode& written, const std::string& path, FormulaReading reading) {
  const YamlNode with_parts = with_sensors(with_components(with_still_state(written)));
  const YamlNode root = with_curves(with_parts);
  const std::string top = "the model file";
  std::vector<std::string> keys = kCommonKeys;
  keys.insert(keys.end(), kLinearKeys.begin(), kLinearKeys.end());
  keys.insert(keys.end(), kVehicleKeys.begin(), kVehicleKeys.end());
  keys.insert(keys.end(), kRegressionKeys.begin(), kRegressionKeys.end());
  keys.insert(keys.end(), kFormulaKeys.begin(), kFormulaKeys.end());
  check_keys(root, top, keys);
  word_of(required(root, "identikal", top, "identikal: 1, the version of the format"), "identikal",
          {"1"});

  Model out;
  out.source = path;
  const YamlNode* name = find(root, "name");
  out.name = name == nullptr ? std::filesystem::path(path).stem().string() : text_of(*name, "name");
  if (const YamlNode* model = find(root, "model")) {
    if (word_of(*model, "model", {"single-track", "regression", "static"}) == "single-track") {
      out.form = VehicleModel();
    } else {
      out.form = RegressionModel();
    }
  }
  refuse_foreign_keys(root, out);
  const bool formulas = find(root, "dynamics") != nullptr || find(root, "states") != nullptr;
  out.time = read_time(root, out, formulas);
  if (formulas) {
    read_formulas(root, reading, out);
  } else if (is_linear(out)) {
    read_linear(root, out);
  } else if (is_vehicle(out)) {
    read_vehicle(root, out);
  } else {
    read_regression(root, out);
  }
  const YamlNode* states = find(root, "states");
  const bool with_units =
      is_vehicle(out) || (states != nullptr && states->kind == YamlNode::Kind::mapping);
  read_constraints(root, with_units, out);
  out.curves = spline_curves(with_parts, out.parameters);
  return out;
}

void set_parameter(Model& model, const std::string& assignment) {
  const std::size_t equals = assignment.find('=');
  const std::string what = in_quotes(assignment);
  if (equals == std::string::npos) throw InputError({}, what, "NAME=VALUE");
  const std::string name(trimmed(std::string_view(assignment).substr(0, equals)));
  const std::string text(trimmed(std::string_view(assignment).substr(equals + 1)));
  if (name.empty()) throw InputError({}, what, "NAME=VALUE");
  const int index = find_parameter(model.parameters, name);
  if (const int own = own_parameter_named(model, name); index < 0 && own >= 0) {
    const std::string& unit = model.parameters[static_cast<std::size_t>(own)].unit;
    model.recordings.found[name] = si_value(parse_quantity(text, {}, what), unit, {}, what);
    return;
  }
  if (index < 0) {
    std::vector<std::string> known;
    for (const Parameter& parameter : model.parameters) known.push_back(parameter.name);
    const std::string hint = did_you_mean(name, known);
    throw InputError({}, fmt::format("{}: the model has no parameter {}", what, in_quotes(name)),
                     hint.empty() ? fmt::format("one of {}", fmt::join(known, ", ")) : "", hint);
  }
  if (name == "steering_ratio" && is_vehicle(model) && as_vehicle(model).steering_at_road_wheel) {
    throw InputError({}, what + ": the input road_wheel_angle makes no use of it");
  }
  Parameter changed = model.parameters[index];
  if (changed.value.size() != 1 && changed.domain != Domain::scaled_identity) {
    throw InputError({}, fmt::format("{}: {} is a matrix", what, name), "",
                     "change its start in the model file");
  }
  const double value = si_value(parse_quantity(text, {}, what), changed.unit, {}, what);
  changed.value = value * Eigen::MatrixXd::Identity(changed.value.rows(), changed.value.cols());
  if (changed.domain == Domain::scalar) {
    std::vector<ParameterRule> rules;
    if (is_vehicle(model)) rules = vehicle_rules(as_vehicle(model).curve);
    const auto rule = std::find_if(rules.begin(), rules.end(),
                                   [&](const ParameterRule& each) { return each.name == name; });
    check_value(changed, rule != rules.end() ? &*rule : nullptr, {});
  } else if (const std::string fault = domain_fault(changed); !fault.empty()) {
    throw InputError({}, fmt::format("{}: the matrix {}", what, fault));
  }
  ParameterSet parameters = model.parameters;
  parameters[index] = std::move(changed);
  if (has_filter(model)) {
    if (const std::optional<ModelFault> fault = fault_at(noise_model(model), parameters)) {
      throw InputError({}, fmt::format("{}: {} then", what, fault->text));
    }
  }
  model.parameters = std::move(parameters);
}

}  // namespace identikal
