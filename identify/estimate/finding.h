// What was found in a recording, a model or an estimate, and what does it do to the status?
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "identify/estimate/status.h"

namespace identikal {

enum class Severity {
  note,
  warning,
  serious,  ///< has the effect that finding_kinds() gives
};

/// As results print it: "note", "warning", "serious".
std::string to_string(Severity severity);

/// One for each kind; finding_kinds() says of each what it means and what it does.
enum class FindingCode {
  // Speaks through the message of the status.
  stopped,
  no_coloured_noise,
  colour_unexplained,
  only_circles,
  test_rejects,
  does_not_predict,
  values_differ,
  outside_fitted_range,
  reference_band,
  reference_disagrees,
  not_identifiable,
  not_converged,
  unconverged_results,
  best_in_doubt,
  still_coloured,
  worse_on_held_out,
  proves_nothing,
  // A channel so wrong that no other form of the model can correct it.
  sign_steering,
  sign_r,
  sign_ay,
  sign_vy,
  wrong_sign,
  units_speed,
  units_ay,
  units_steering,
  clock_offset,
  swapped_channels,
  // What the survey of a recording finds.
  no_time,
  several_runs,
  repeated_stamps,
  too_short,
  no_steering,
  no_speed,
  no_yaw_rate,
  dead_channel,
  stuck_channel,
  held_samples,
  reversing,
  standstill,
  spin,
  countersteer,
  rows_left_out,
  clock_unclear,
  several_clocks,
  one_clock,
  one_measurement,
  gain_ay,
  guessed_by_physics,
  unit_unclear,
  // How recordings go with the model file.
  starts_anew,
  starts_within,
  goes_on,
  step_differs,
  repeated_data,
  own_data,
  data_treated,
  unknown_unit,
  doubtful_result,
  model_changed,
  // Estimates of noise.
  turn,
  outliers,
  offset,
  prior_edge,
  draws_left_behind,
  no_measurement_noise,
  outliers_left_out,
  too_many_outliers,
  few_samples,
  coloured_innovations,
  input_in_innovations,
  expected_errors,
  innovation_size,
  innovations_not_gaussian,
  innovations_change_size,
  depends_on_sampling,
  heavy_tails,
  nonlinear,
  methods_disagree,
  several_maxima,
  evaluation_method,
  integration,
  noise_vanished,
  noise_source,
  // Fits of vehicles.
  dead_output,
  constant_steering,
  tyre_saturation,
  no_saturation,
  steering_gain,
  steering_delay,
  steering_steps,
  steering_noise,
  structure_dependent,
  sensor_differs,
  car_changes,
  hold_out,
  insufficient_power,
  tracked_only,
  consequences,
  // What a misread channel causes too.
  constraint,
  at_bound,
  poor_fit,
  noise_differs,
  coloured_residuals,
  weak_direction,
  steering_ratio,
  implausible_Iz,
  implausible_Cf,
  implausible_Cr,
  // Recursive least squares.
  coloured_errors,
  short_memory,
  other,  ///< of another version: Finding::other holds its name
};

/// Causes before consequences: the first of these ranks that has an effect decides the status.
enum class Rank {
  stopped,       ///< nothing else was finished
  answer,        ///< the question has an answer that no other finding can change
  misreading,    ///< of a channel; all that follows rests on it
  undetermined,  ///< along a valley of equally likely values no search converges
  unfinished,    ///< short of the optimum, fits say nothing yet
  other,
  consequence,  ///< what misread channels cause too
};

/// What of a finding the message of the status takes, where it decides.
enum class InMessage {
  nothing,
  name,      ///< in the list of reasons not to use the values
  misfit,    ///< that the data do not fit the model, behind the message of an ok result
  text,      ///< its text is the message
  addition,  ///< its text, behind the message of an ok result
};

struct FindingKind {
  FindingCode code;
  std::string_view name;     ///< stable, as results print it
  Severity severity, worst;  ///< the usual one, and the highest that it may have
  Status effect;             ///< of a serious one on the status; ok: none
  Rank rank;
  InMessage in_message;
  std::string_view meaning;  ///< in one sentence
};

/// All kinds, in the order of FindingCode: the one table of what a finding does.
std::span<const FindingKind> finding_kinds();

const FindingKind& kind_of(FindingCode code);

/// Whether findings of this code are said by the message of the status, and not printed again.
bool concludes(FindingCode code);

/// One thing to change, as a program can do it.
struct Change {
  std::string option;  ///< of the command line, e.g. "--reject-outliers"; empty: none
  std::string model;   ///< YAML to merge into the model file; empty: none
};

struct Finding {
  FindingCode code = FindingCode::other;
  Severity severity = Severity::note;
  std::vector<std::string> about;
  std::string text;      ///< what was seen, with figures
  std::string remedy{};  ///< what to do about it; may be empty
  std::string other{};   ///< the name of a code that this version does not know
  /// The remedy, where the job that found this has tried it and it cures; else empty.
  std::vector<Change> changes{};
};

using Findings = std::vector<Finding>;

/// With the usual severity of its code.
///
/// Example:
///
///     const Finding late = make_finding(FindingCode::clock_offset, {"r"}, "r comes 0.2 s late");
///     std::printf("%s: %s\n", name_of(late).c_str(), late.text.c_str());
Finding make_finding(FindingCode code, std::vector<std::string> about, std::string text,
                     std::string remedy = "");

/// As results print it, e.g. "tyre_saturation".
std::string name_of(const Finding& finding);

/// Takes code and name from what a result prints, of whatever version it is.
void set_code(Finding& finding, const std::string& name);

/// A channel that is read wrongly, which explains other findings.
bool is_misreading(const Finding& finding);
bool has_misreading(const Findings& findings);

/// Those that are printed among the warnings: all but those that the message says.
Findings printed(const Findings& findings);

void append(Findings& to, const Findings& more);

/// The table for people, in Markdown (docs/troubleshooting.md): the codes that are printed, and what
/// else decides a status.
std::string finding_table();

}  // namespace identikal
