// Which further part might a model of formulas have?
#pragma once

#include <string>
#include <vector>

#include "identify/model/yaml_reader.h"

namespace identikal {

enum class ExtensionKind {
  bias,           ///< a constant error of outputs or inputs, a parameter each
  scale,          ///< of outputs or inputs: a factor, a parameter each
  delay,          ///< of an output in continuous time: y(t) = h(x(t - d)), to first order in d
  lasting_error,  ///< of outputs or inputs: e' = -e/tau + w, a state each (Gauss-Markov)
  process_noise,  ///< white noise in the dynamics of a state that has none
  coloured_process_noise,    ///< in the dynamics of states that have white noise: d' = -d/tau + w
  measurement_noise_change,  ///< of outputs: from a time on all variances times a ratio
  process_noise_change,      ///< of all states that have process noise, likewise
  quadratic_damping,         ///< of a state: x' = f - c x |x|
  dry_friction,              ///< of a state: x' = f - c tanh(x/s), s known
  cubic_stiffness,           ///< of a state by another one: x' = f - c z^3; names: x, z
  curved_input,              ///< of an input: u + c u |u| acts in its place
};

/// A parameter of what is measured, and no state: bias, scale, delay.
inline bool is_constant(ExtensionKind kind) {
  return kind == ExtensionKind::bias || kind == ExtensionKind::scale ||
         kind == ExtensionKind::delay;
}

/// A parameter of a term that is not linear, in the dynamics of a state or of an input.
inline bool is_curve(ExtensionKind kind) {
  return kind == ExtensionKind::quadratic_damping || kind == ExtensionKind::dry_friction ||
         kind == ExtensionKind::cubic_stiffness || kind == ExtensionKind::curved_input;
}

struct ModelExtension {
  ExtensionKind kind = ExtensionKind::bias;
  std::vector<std::string> names;  ///< outputs, inputs, or states
  std::vector<double> size;        ///< a standard deviation each, where a search begins, SI; of a
                                   ///< change the ratio of variances; of a scale and a delay [s]
                                   ///< what is little for it; of a state's damping and friction
                                   ///< the state's own size
  /// What lasts: one deviation and time constant for all. Bias and scale of two outputs: as much of
  /// each, in opposite directions.
  bool alike = false;
  /// Of a change: its time t, as the model's formulas have it [s]; minus infinity: always.
  double from = 0.0;
};
/// "biases of d0, d1", "a ratio between r0 and r1, half of it in each", "an error that lasts, of
/// z", "process noise of vx", "coloured process noise of vx, vy, alike", "another measurement noise
/// of z from 120 s on", "measurement noise of z of a size of its own", "dry friction of w".
std::string in_words(const ModelExtension& extension);

/// Outputs whose measurement noise is written with the same variance, where that is not a number:
/// sensors of one kind.
std::vector<std::vector<std::string>> outputs_alike(const YamlNode& model);

/// States whose process noise is written alike.
std::vector<std::vector<std::string>> states_alike(const YamlNode& model);

bool has_continuous_time(const YamlNode& model);

/// Does the formula of a state's dynamics hold the name?
bool moves_by(const YamlNode& model, const std::string& state, const std::string& name);

/// Can it come late: is time continuous, and is it written in states, of which some move without
/// noise, and parameters alone?
bool can_be_late(const YamlNode& model, const std::string& output);

/// The tree of a model file with the further part, and parameters for it: bias_OUTPUT;
/// scale_OUTPUT; delay_OUTPUT; bias_OUTPUT_OTHER and scale_OUTPUT_OTHER, by which the other is off
/// the other way (minus the one, over the other); sd_OUTPUT and tau_OUTPUT of a lasting error,
/// whose state is error_OUTPUT (sd_errors and tau_errors of those that are alike); q_STATE;
/// sd_disturbance_STATE and tau_disturbance_STATE of coloured process noise, whose state is
/// disturbance_STATE (sd_disturbances and tau_disturbances); ratio_OUTPUT or ratio_process of a
/// change, at the known time change_OUTPUT or change_process, of which there is none where it is
/// always; drag_STATE; friction_STATE, with slow_STATE, a tenth of the state's size, known;
/// cubic_STATE_OTHER; curve_INPUT. What lasts begins with its own variance.
///
/// Example:
///
///     const YamlNode root = read_yaml("tracker.yaml");
///     const YamlNode more = extended(root, {ExtensionKind::bias, {"z"}, {0.1}}, 0.1);
///     std::puts(model_file_text(more).c_str());
///
/// Source: Singer (1970), "Estimating optimal tracking filter performance for manned maneuvering
/// targets", IEEE Trans. Aerospace and Electronic Systems 6 (coloured process noise of a tracker).
///
/// @param step  the sampling period [s]
/// @throws InputError where the tree is not that of formulas, or a name is taken
YamlNode extended(YamlNode model, const ModelExtension& extension, double step);

/// Text of a model file that reads as this tree.
std::string model_file_text(const YamlNode& model);

}  // namespace identikal
