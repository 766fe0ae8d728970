#include "identify/model/internal/linear_form.h"

#include <utility>

#include <fmt/format.h>

#include "identify/model/internal/condition_form.h"
#include "identify/model/internal/noise_form.h"
#include "identify/model/internal/recordings_form.h"
#include "identify/model/internal/reference_form.h"
#include "identify/model/matrix_reader.h"
#include "identify/model/model_values.h"

namespace identikal {
namespace {

// The states are x1, x2, ... in formulas of them.
StateReferences references_of(const YamlNode& root, const Model& model, Eigen::Index states) {
  ModelFormulas formulas;
  formulas.states = static_cast<int>(states);
  formulas.inputs = static_cast<int>(model.inputs.size());
  std::vector<std::string> names;
  for (Eigen::Index i = 1; i <= states; ++i) names.push_back(fmt::format("x{}", i));
  const std::vector<std::string> state_names = names;
  for (const ChannelSource& input : model.inputs) names.push_back(input.name);
  names.emplace_back("t");
  NamedParameters none;
  const auto first = static_cast<int>(names.size());
  const auto read = [&](const YamlNode& node, const ChannelSource& channel) {
    return read_formula(node, fmt::format("reference '{}'", channel.name), names, first, none);
  };
  return read_references(root, formulas, state_names, {}, read);
}

// Do samples count where their time stamps are, rather than every step?
bool read_irregular(const YamlNode& time, bool continuous) {
  const YamlNode* sampling = find(time, "sampling");
  if (sampling == nullptr) return false;
  if (word_of(*sampling, "sampling", {"regular", "irregular"}) == "regular") return false;
  if (!continuous) {
    throw InputError(sampling->at, "a discrete-time model has nothing between samples",
                     "no such key here, or kind: continuous");
  }
  if (find(time, "column") == nullptr) {
    throw InputError(sampling->at, "irregular sampling without time stamps", "column: NAME");
  }
  return true;
}

}  // namespace

void read_linear(const YamlNode& root, Model& out) {
  NamedParameters parameters = read_named_parameters(root);
  const std::string top = "the model file";
  const YamlNode& outputs = required(root, "outputs", top, "outputs: [{name: y, column: y}]");
  out.outputs = read_channels(outputs, "outputs", {}, kOutputKeys);
  PhysicalNames of_outputs;
  for (std::size_t i = 0; i < out.outputs.size(); ++i) {
    of_outputs.outputs.push_back(
        {out.outputs[i].name, {}, own_sd(outputs, i), out.outputs[i].unit});
  }
  if (const YamlNode* inputs = find(root, "inputs")) {
    out.inputs = read_channels(*inputs, "inputs", {});
  }
  let_move(parameters, out.inputs);
  out.recordings = read_recordings(root, parameters);
  const auto ny = static_cast<Eigen::Index>(out.outputs.size());
  const auto nu = static_cast<Eigen::Index>(out.inputs.size());

  LinearModel& model = as_linear(out);
  const YamlNode& A = required(root, "A", top, "A: a list of rows, states x states");
  model.A = read_matrix(A, "A", {kAnySize, kAnySize, "states x states"}, parameters, model);
  const Eigen::Index n = model.A.constant.rows();
  if (model.A.constant.cols() != n) {
    throw InputError(A.at, fmt::format("A is {} x {}", n, model.A.constant.cols()),
                     "a square matrix (states x states)");
  }
  model.C = read_matrix(required(root, "C", top, "C: a list of rows, outputs x states"), "C",
                        {ny, n, "outputs x states"}, parameters, model);
  const auto of_inputs = [&](const char* key, const MatrixShape& want) {
    const YamlNode* node = find(root, key);
    if (node != nullptr && nu == 0) {
      throw InputError(node->at, fmt::format("{} is given but the model has no inputs", key),
                       "inputs: [{name: u, column: u}]");
    }
    return node == nullptr ? constant_matrix(Eigen::MatrixXd::Zero(want.rows, want.cols))
                           : read_matrix(*node, key, want, parameters, model);
  };
  if (nu > 0) required(root, "B", top, "B: a list of rows, states x inputs");
  model.B = of_inputs("B", {n, nu, "states x inputs"});
  model.D = of_inputs("D", {ny, nu, "outputs x inputs"});
  const YamlNode& time = required(root, "time", top, "");
  if (const YamlNode* kind = find(time, "kind")) {
    model.continuous = text_of(*kind, "kind") == "continuous";
  }
  if (const YamlNode* hold = find(time, "inputs")) {
    const bool linear = word_of(*hold, "inputs", {"zoh", "foh"}) == "foh";
    if (!model.continuous) {
      throw InputError(hold->at, "a discrete-time model has nothing between samples",
                       "no 'inputs' here, or kind: continuous");
    }
    model.hold = linear ? InputHold::linear : InputHold::constant;
  }
  model.irregular = read_irregular(time, model.continuous);
  read_noise(root, of_outputs, parameters, model);
  out.student = read_student(root, parameters);
  read_initial(root, {}, parameters, model);
  if (out.time.step > 0.0) model.dt = out.time.step;
  out.references = references_of(root, out, n);
  read_conditions(root, out);
  refuse_unused(parameters);
  bound_sources(root, out.recordings, parameters);
  if (const std::optional<ModelFault> fault = fault_at(model, parameters.set)) {
    throw InputError(find(root, fault->key)->at, fault->text);
  }
  if (changes(model) || !out.recordings.empty()) {
    refuse_stationary_start_of_changes(root, model);
    out.form = changing_model(std::move(model), nu, parameters.names.size());
  }
  out.parameters = std::move(parameters.set);
  add_spreads(root, out);
}

}  // namespace identikal
