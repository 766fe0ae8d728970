#include "identify/estimate/finding.h"

#include <algorithm>
#include <array>
#include <iterator>
#include <utility>

#include <fmt/format.h>

namespace identikal {
namespace {

constexpr std::array<FindingKind, 111> kKinds = {{
    {FindingCode::stopped, "stopped", Severity::serious, Severity::serious, Status::not_converged,
     Rank::stopped, InMessage::text, "The caller stopped the work: what stands is of a part of it"},
    {FindingCode::no_coloured_noise, "no_coloured_noise", Severity::serious, Severity::serious,
     Status::rejected, Rank::answer, InMessage::text,
     "Whiteness is not rejected: no shaping filter is needed"},
    {FindingCode::colour_unexplained, "colour_unexplained", Severity::serious, Severity::serious,
     Status::untrusted, Rank::answer, InMessage::text,
     "The innovations are not white, and no shaping filter explains them"},
    {FindingCode::only_circles, "only_circles", Severity::serious, Severity::serious,
     Status::rejected, Rank::answer, InMessage::text,
     "Steady-state circles determine products of parameters only"},
    {FindingCode::test_rejects, "test_rejects", Severity::serious, Severity::serious,
     Status::rejected, Rank::answer, InMessage::text, "A test rejects the filter on these data"},
    {FindingCode::does_not_predict, "does_not_predict", Severity::serious, Severity::serious,
     Status::rejected, Rank::answer, InMessage::text, "A fit is lower than what was asked for"},
    {FindingCode::values_differ, "values_differ", Severity::serious, Severity::serious,
     Status::rejected, Rank::answer, InMessage::text,
     "A refit on these data gives significantly different values"},
    {FindingCode::outside_fitted_range, "outside_fitted_range", Severity::serious,
     Severity::serious, Status::untrusted, Rank::answer, InMessage::text,
     "A drive beyond what the result was fitted to contradicts it"},
    {FindingCode::reference_band, "reference_band", Severity::warning, Severity::serious,
     Status::untrusted, Rank::other, InMessage::misfit,
     "Errors against a reference are not of the size that the filter says, by more than a factor "
     "of two in their mean square"},
    {FindingCode::reference_disagrees, "reference_disagrees", Severity::warning, Severity::warning,
     Status::ok, Rank::other, InMessage::nothing,
     "Other noise brings the estimates significantly closer to a reference than the likeliest"},
    {FindingCode::not_identifiable, "not_identifiable", Severity::serious, Severity::serious,
     Status::rejected, Rank::undetermined, InMessage::text,
     "The data do not determine every unknown"},
    {FindingCode::not_converged, "not_converged", Severity::serious, Severity::serious,
     Status::not_converged, Rank::unfinished, InMessage::text, "The search did not converge"},
    {FindingCode::unconverged_results, "unconverged_results", Severity::serious, Severity::serious,
     Status::not_converged, Rank::unfinished, InMessage::addition,
     "Of the results compared, not every search has converged"},
    {FindingCode::best_in_doubt, "best_in_doubt", Severity::serious, Severity::serious,
     Status::untrusted, Rank::other, InMessage::addition,
     "The best of the results compared is itself not ok"},
    {FindingCode::still_coloured, "still_coloured", Severity::serious, Severity::serious,
     Status::untrusted, Rank::other, InMessage::addition,
     "With the shaping filter the innovations are still not white"},
    {FindingCode::worse_on_held_out, "worse_on_held_out", Severity::serious, Severity::serious,
     Status::untrusted, Rank::other, InMessage::addition,
     "On the part held out the shaping filter does worse than white noise"},
    {FindingCode::proves_nothing, "proves_nothing", Severity::note, Severity::note, Status::ok,
     Rank::other, InMessage::addition, "The result was made from the data that it is validated on"},
    {FindingCode::sign_steering, "sign_steering", Severity::serious, Severity::serious,
     Status::untrusted, Rank::misreading, InMessage::name,
     "Steering and yaw rate have opposite signs"},
    {FindingCode::sign_r, "sign_r", Severity::serious, Severity::serious, Status::untrusted,
     Rank::misreading, InMessage::name, "The yaw rate has the wrong sign"},
    {FindingCode::sign_ay, "sign_ay", Severity::serious, Severity::serious, Status::untrusted,
     Rank::misreading, InMessage::name, "The lateral acceleration has the wrong sign"},
    {FindingCode::sign_vy, "sign_vy", Severity::serious, Severity::serious, Status::untrusted,
     Rank::misreading, InMessage::name, "The lateral velocity or the sideslip has the wrong sign"},
    {FindingCode::wrong_sign, "wrong_sign", Severity::serious, Severity::serious, Status::untrusted,
     Rank::misreading, InMessage::name, "With a channel reversed the car fits much better"},
    {FindingCode::units_speed, "units_speed", Severity::serious, Severity::serious,
     Status::untrusted, Rank::misreading, InMessage::name, "The speed is in another unit"},
    {FindingCode::units_ay, "units_ay", Severity::serious, Severity::serious, Status::untrusted,
     Rank::misreading, InMessage::name, "The lateral acceleration is in another unit"},
    {FindingCode::units_steering, "units_steering", Severity::serious, Severity::serious,
     Status::untrusted, Rank::misreading, InMessage::name, "The steering angle is in another unit"},
    {FindingCode::clock_offset, "clock_offset", Severity::serious, Severity::serious,
     Status::untrusted, Rank::misreading, InMessage::name, "A channel lags behind the others"},
    {FindingCode::swapped_channels, "swapped_channels", Severity::serious, Severity::serious,
     Status::untrusted, Rank::misreading, InMessage::name, "Two channels are taken for each other"},
    {FindingCode::no_time, "no_time", Severity::serious, Severity::serious, Status::ok, Rank::other,
     InMessage::nothing, "No column holds time stamps"},
    {FindingCode::several_runs, "several_runs", Severity::serious, Severity::serious, Status::ok,
     Rank::other, InMessage::nothing, "The file holds several runs"},
    {FindingCode::repeated_stamps, "repeated_stamps", Severity::warning, Severity::warning,
     Status::ok, Rank::other, InMessage::nothing, "Rows have the time stamp of the row before"},
    {FindingCode::too_short, "too_short", Severity::serious, Severity::serious, Status::ok,
     Rank::other, InMessage::nothing, "The car moves for less than a manoeuvre takes"},
    {FindingCode::no_steering, "no_steering", Severity::serious, Severity::serious, Status::ok,
     Rank::other, InMessage::nothing, "There is no steering angle, or it never changes"},
    {FindingCode::no_speed, "no_speed", Severity::serious, Severity::serious, Status::ok,
     Rank::other, InMessage::nothing, "There is no speed"},
    {FindingCode::no_yaw_rate, "no_yaw_rate", Severity::warning, Severity::serious, Status::ok,
     Rank::other, InMessage::nothing, "There is no yaw rate"},
    {FindingCode::dead_channel, "dead_channel", Severity::note, Severity::serious, Status::ok,
     Rank::other, InMessage::nothing, "A channel never changes or holds no samples"},
    {FindingCode::stuck_channel, "stuck_channel", Severity::serious, Severity::serious,
     Status::untrusted, Rank::other, InMessage::name,
     "A channel stands still while another one moves"},
    {FindingCode::held_samples, "held_samples", Severity::warning, Severity::warning, Status::ok,
     Rank::other, InMessage::nothing,
     "A channel repeats samples: its sensor is slower than the rows"},
    {FindingCode::reversing, "reversing", Severity::warning, Severity::warning, Status::ok,
     Rank::other, InMessage::nothing,
     "The car reverses, or the axis of its speed points backwards"},
    {FindingCode::standstill, "standstill", Severity::note, Severity::note, Status::ok, Rank::other,
     InMessage::nothing, "The car stands for a part of the time"},
    {FindingCode::spin, "spin", Severity::warning, Severity::warning, Status::ok, Rank::other,
     InMessage::nothing, "The car spins"},
    {FindingCode::countersteer, "countersteer", Severity::warning, Severity::warning, Status::ok,
     Rank::other, InMessage::nothing,
     "The driver holds a sliding car by steering against the turn"},
    {FindingCode::rows_left_out, "rows_left_out", Severity::note, Severity::note, Status::ok,
     Rank::other, InMessage::nothing, "Rows that no model of a driving car describes are left out"},
    {FindingCode::clock_unclear, "clock_unclear", Severity::note, Severity::note, Status::ok,
     Rank::other, InMessage::nothing, "A channel may lag behind the others"},
    {FindingCode::several_clocks, "several_clocks", Severity::note, Severity::note, Status::ok,
     Rank::other, InMessage::nothing, "Channels come from several clocks"},
    {FindingCode::one_clock, "one_clock", Severity::note, Severity::note, Status::ok, Rank::other,
     InMessage::nothing, "Two channels lag alike: they share a clock"},
    {FindingCode::one_measurement, "one_measurement", Severity::note, Severity::note, Status::ok,
     Rank::other, InMessage::nothing, "Two channels are one measurement, computed two ways"},
    {FindingCode::gain_ay, "gain_ay", Severity::warning, Severity::warning, Status::ok, Rank::other,
     InMessage::nothing, "The lateral acceleration is larger or smaller than speed times yaw rate"},
    {FindingCode::guessed_by_physics, "guessed_by_physics", Severity::note, Severity::note,
     Status::ok, Rank::other, InMessage::nothing,
     "A column was recognised by its values, not by its name"},
    {FindingCode::unit_unclear, "unit_unclear", Severity::note, Severity::note, Status::ok,
     Rank::other, InMessage::nothing, "Several units of a column are plausible"},
    {FindingCode::starts_anew, "starts_anew", Severity::warning, Severity::warning, Status::ok,
     Rank::other, InMessage::nothing, "The filter restarts from 'initial' behind gaps"},
    {FindingCode::starts_within, "starts_within", Severity::note, Severity::note, Status::ok,
     Rank::other, InMessage::nothing, "The filter starts from 'initial' within the recording"},
    {FindingCode::goes_on, "goes_on", Severity::note, Severity::note, Status::ok, Rank::other,
     InMessage::nothing, "The filter has run through the rows before the range"},
    {FindingCode::step_differs, "step_differs", Severity::serious, Severity::serious,
     Status::untrusted, Rank::other, InMessage::name,
     "A column of time stamps contradicts the step of the model file"},
    {FindingCode::repeated_data, "repeated_data", Severity::warning, Severity::warning, Status::ok,
     Rank::other, InMessage::nothing, "The same data are given twice, and count twice"},
    {FindingCode::own_data, "own_data", Severity::warning, Severity::warning, Status::ok,
     Rank::other, InMessage::nothing, "What is validated or held out is what was fitted"},
    {FindingCode::data_treated, "data_treated", Severity::note, Severity::note, Status::ok,
     Rank::other, InMessage::nothing, "What reading the file did to the data"},
    {FindingCode::unknown_unit, "unknown_unit", Severity::warning, Severity::warning, Status::ok,
     Rank::other, InMessage::nothing, "A unit in the header is not known"},
    {FindingCode::doubtful_result, "doubtful_result", Severity::warning, Severity::warning,
     Status::ok, Rank::other, InMessage::nothing, "The result that is used is itself not ok"},
    {FindingCode::model_changed, "model_changed", Severity::warning, Severity::warning, Status::ok,
     Rank::other, InMessage::nothing, "The model file has changed since the result"},
    {FindingCode::turn, "turn", Severity::serious, Severity::serious, Status::untrusted,
     Rank::misreading, InMessage::name, "An angle jumps by a turn"},
    {FindingCode::outliers, "outliers", Severity::warning, Severity::serious, Status::untrusted,
     Rank::other, InMessage::misfit,
     "Samples lie far off; serious where an estimate moves by more than 2.6 errors and 5 % without "
     "them, or where they make up more than 5 % of the power of given values' innovations"},
    {FindingCode::offset, "offset", Severity::warning, Severity::serious, Status::untrusted,
     Rank::other, InMessage::misfit,
     "Innovations have a mean; serious where it makes up more than 5 % of their power"},
    {FindingCode::prior_edge, "prior_edge", Severity::serious, Severity::serious, Status::untrusted,
     Rank::other, InMessage::misfit, "A posterior is piled up against the edge of its prior"},
    {FindingCode::draws_left_behind, "draws_left_behind", Severity::serious, Severity::serious,
     Status::untrusted, Rank::other, InMessage::misfit,
     "Samples are so far off that the draws of a posterior could not follow them"},
    {FindingCode::no_measurement_noise, "no_measurement_noise", Severity::serious,
     Severity::serious, Status::untrusted, Rank::other, InMessage::name,
     "The measurement noise of an output was estimated as zero"},
    {FindingCode::outliers_left_out, "outliers_left_out", Severity::note, Severity::note,
     Status::ok, Rank::other, InMessage::nothing, "Samples were left out as outliers"},
    {FindingCode::too_many_outliers, "too_many_outliers", Severity::serious, Severity::serious,
     Status::untrusted, Rank::other, InMessage::misfit,
     "More than 10 % of the samples of an output lie off: none was left out"},
    {FindingCode::few_samples, "few_samples", Severity::warning, Severity::serious,
     Status::untrusted, Rank::other, InMessage::misfit,
     "So few samples that the errors are too small; serious below three for each unknown"},
    {FindingCode::coloured_innovations, "coloured_innovations", Severity::warning,
     Severity::serious, Status::untrusted, Rank::other, InMessage::misfit,
     "Innovations are not white; serious where their own past explains more than 2 % of them, or "
     "with p below 0.001 more than 0.5 %"},
    {FindingCode::input_in_innovations, "input_in_innovations", Severity::warning,
     Severity::serious, Status::untrusted, Rank::other, InMessage::misfit,
     "Innovations follow earlier inputs; serious where these explain more than 2 % of them, or "
     "with "
     "p below 0.001 more than 0.5 %"},
    {FindingCode::expected_errors, "expected_errors", Severity::serious, Severity::serious,
     Status::untrusted, Rank::other, InMessage::misfit,
     "How far the states' errors are expected to be above what is possible, where the innovations "
     "contradict the model; a note where that is at most 3 % and their squares are 2/3 to 3/2 of "
     "the filter's variances: then what contradicts it is no more than a warning"},
    {FindingCode::innovation_size, "innovation_size", Severity::warning, Severity::warning,
     Status::ok, Rank::other, InMessage::nothing,
     "Innovations are larger than the filter predicts"},
    {FindingCode::innovations_not_gaussian, "innovations_not_gaussian", Severity::note,
     Severity::note, Status::ok, Rank::other, InMessage::nothing,
     "Innovations are not Gaussian: p-values are approximate"},
    {FindingCode::innovations_change_size, "innovations_change_size", Severity::note,
     Severity::note, Status::ok, Rank::other, InMessage::nothing,
     "Innovations change their size with time: p-values are approximate"},
    {FindingCode::depends_on_sampling, "depends_on_sampling", Severity::serious, Severity::serious,
     Status::untrusted, Rank::other, InMessage::misfit,
     "Every second, third or fifth sample alone contradicts an estimate, by more than 5 % of it"},
    {FindingCode::heavy_tails, "heavy_tails", Severity::serious, Severity::serious,
     Status::untrusted, Rank::other, InMessage::misfit,
     "The innovations' variance is more than 10 % above that of their bulk, by rare large ones"},
    {FindingCode::nonlinear, "nonlinear", Severity::warning, Severity::serious, Status::untrusted,
     Rank::other, InMessage::misfit,
     "A curve of a channel, or of a state, explains part of what the model leaves"},
    {FindingCode::methods_disagree, "methods_disagree", Severity::warning, Severity::warning,
     Status::ok, Rank::other, InMessage::nothing, "Two methods differ by more than their errors"},
    {FindingCode::several_maxima, "several_maxima", Severity::note, Severity::serious,
     Status::untrusted, Rank::other, InMessage::name,
     "Not every start reached the same optimum; a warning where some ended at other maxima, "
     "serious where other values are as likely"},
    {FindingCode::evaluation_method, "evaluation_method", Severity::note, Severity::note,
     Status::ok, Rank::other, InMessage::nothing,
     "A slower evaluation of the likelihood had to be taken"},
    {FindingCode::integration, "integration", Severity::note, Severity::serious, Status::untrusted,
     Rank::other, InMessage::misfit,
     "Rates of change jump, or are faster than the integration follows; serious where a step given "
     "by hand makes another likelihood than the model's"},
    {FindingCode::noise_vanished, "noise_vanished", Severity::warning, Severity::warning,
     Status::ok, Rank::other, InMessage::nothing,
     "A shaping filter has taken the place of a noise"},
    {FindingCode::noise_source, "noise_source", Severity::note, Severity::note, Status::ok,
     Rank::other, InMessage::nothing,
     "The outputs do not tell coloured process from measurement noise"},
    {FindingCode::dead_output, "dead_output", Severity::serious, Severity::serious,
     Status::untrusted, Rank::other, InMessage::name,
     "An output is constant or empty and was left out"},
    {FindingCode::constant_steering, "constant_steering", Severity::warning, Severity::warning,
     Status::ok, Rank::other, InMessage::nothing, "The steering angle hardly changes"},
    {FindingCode::tyre_saturation, "tyre_saturation", Severity::note, Severity::serious,
     Status::untrusted, Rank::other, InMessage::name,
     "Tyre forces saturate; serious above 10 % of the linear force"},
    {FindingCode::no_saturation, "no_saturation", Severity::note, Severity::note, Status::ok,
     Rank::other, InMessage::nothing,
     "The largest force of an axle is beyond what the recording determines"},
    {FindingCode::steering_gain, "steering_gain", Severity::warning, Severity::serious,
     Status::untrusted, Rank::other, InMessage::name,
     "The recording contradicts the given steering ratio"},
    {FindingCode::steering_delay, "steering_delay", Severity::warning, Severity::serious,
     Status::untrusted, Rank::other, InMessage::name, "The steering angle lags"},
    {FindingCode::steering_steps, "steering_steps", Severity::warning, Severity::serious,
     Status::untrusted, Rank::other, InMessage::name,
     "The steps of the steering's sensor change the values"},
    {FindingCode::steering_noise, "steering_noise", Severity::note, Severity::serious,
     Status::untrusted, Rank::other, InMessage::name,
     "The noise of the steering's sensor attenuates the values"},
    {FindingCode::structure_dependent, "structure_dependent", Severity::serious, Severity::serious,
     Status::untrusted, Rank::other, InMessage::name,
     "A parameter hangs on what the model leaves out: lags, roll, bending tyres"},
    {FindingCode::sensor_differs, "sensor_differs", Severity::serious, Severity::serious,
     Status::untrusted, Rank::other, InMessage::name,
     "A sensor is late, filtered or elsewhere, and the model file does not say so"},
    {FindingCode::car_changes, "car_changes", Severity::serious, Severity::serious,
     Status::untrusted, Rank::other, InMessage::name,
     "The car is another one (tyres, load, road) in the later half of the recording"},
    {FindingCode::hold_out, "hold_out", Severity::warning, Severity::warning, Status::ok,
     Rank::other, InMessage::nothing, "Held-out data are predicted much worse than those fitted"},
    {FindingCode::insufficient_power, "insufficient_power", Severity::warning, Severity::warning,
     Status::ok, Rank::other, InMessage::nothing,
     "These data would not show an error that matters"},
    {FindingCode::tracked_only, "tracked_only", Severity::note, Severity::note, Status::ok,
     Rank::other, InMessage::nothing,
     "Least squares follow changes; noise in the regressors biases values"},
    {FindingCode::consequences, "consequences", Severity::note, Severity::note, Status::ok,
     Rank::other, InMessage::nothing, "Also found, as the misread channel above causes it"},
    {FindingCode::constraint, "constraint", Severity::note, Severity::warning, Status::ok,
     Rank::consequence, InMessage::nothing,
     "A constraint holds the estimate back, or the data speak against it"},
    {FindingCode::at_bound, "at_bound", Severity::note, Severity::serious, Status::untrusted,
     Rank::consequence, InMessage::name,
     "A parameter ended at its bound; serious where that biases the stiffnesses"},
    {FindingCode::poor_fit, "poor_fit", Severity::serious, Severity::serious, Status::untrusted,
     Rank::consequence, InMessage::name, "The simulation explains too little of an output"},
    {FindingCode::noise_differs, "noise_differs", Severity::warning, Severity::warning, Status::ok,
     Rank::consequence, InMessage::nothing,
     "A residual is not as large as the noise in the model file"},
    {FindingCode::coloured_residuals, "coloured_residuals", Severity::warning, Severity::warning,
     Status::ok, Rank::consequence, InMessage::nothing,
     "Residuals are correlated in time: the model is incomplete"},
    {FindingCode::weak_direction, "weak_direction", Severity::warning, Severity::serious,
     Status::untrusted, Rank::consequence, InMessage::name,
     "Parameters are poorly determined in combination; serious where Cf, Cr or Iz is not known to "
     "a quarter"},
    {FindingCode::steering_ratio, "steering_ratio", Severity::warning, Severity::warning,
     Status::ok, Rank::consequence, InMessage::nothing, "The given steering ratio is wrong"},
    {FindingCode::implausible_Iz, "implausible_Iz", Severity::note, Severity::note, Status::ok,
     Rank::consequence, InMessage::nothing, "The yaw inertia is not that of a car"},
    {FindingCode::implausible_Cf, "implausible_Cf", Severity::note, Severity::note, Status::ok,
     Rank::consequence, InMessage::nothing, "The front stiffness is not that of a car's tyres"},
    {FindingCode::implausible_Cr, "implausible_Cr", Severity::note, Severity::note, Status::ok,
     Rank::consequence, InMessage::nothing, "The rear stiffness is not that of a car's tyres"},
    {FindingCode::coloured_errors, "coloured_errors", Severity::warning, Severity::warning,
     Status::ok, Rank::other, InMessage::nothing, "Errors are correlated with the ones before"},
    {FindingCode::short_memory, "short_memory", Severity::warning, Severity::warning, Status::ok,
     Rank::other, InMessage::nothing, "The shortest memory tried predicts best"},
    {FindingCode::other, "other", Severity::note, Severity::serious, Status::untrusted, Rank::other,
     InMessage::name, "A code of another version, kept as the result has it"},
}};

constexpr bool in_order() {
  for (std::size_t i = 0; i < kKinds.size(); ++i) {
    if (static_cast<std::size_t>(kKinds[i].code) != i) return false;
  }
  return static_cast<std::size_t>(FindingCode::other) + 1 == kKinds.size();
}
static_assert(in_order(), "one row for each code, in their order");

}  // namespace

std::string to_string(Severity severity) {
  switch (severity) {
    case Severity::note:
      return "note";
    case Severity::warning:
      return "warning";
    case Severity::serious:
      return "serious";
  }
  return "";
}

std::span<const FindingKind> finding_kinds() { return kKinds; }

const FindingKind& kind_of(FindingCode code) { return kKinds[static_cast<std::size_t>(code)]; }

bool concludes(FindingCode code) {
  const InMessage in_message = kind_of(code).in_message;
  return in_message == InMessage::text || in_message == InMessage::addition;
}

Finding make_finding(FindingCode code, std::vector<std::string> about, std::string text,
                     std::string remedy) {
  return {code, kind_of(code).severity, std::move(about), std::move(text), std::move(remedy)};
}

std::string name_of(const Finding& finding) {
  return finding.code == FindingCode::other ? finding.other
                                            : std::string(kind_of(finding.code).name);
}

void set_code(Finding& finding, const std::string& name) {
  const auto* known = std::find_if(kKinds.begin(), kKinds.end(),
                                   [&](const FindingKind& kind) { return kind.name == name; });
  // A result prints no finding that speaks through the message: such a name is another version's.
  const bool is_known =
      known != kKinds.end() && known->code != FindingCode::other && !concludes(known->code);
  finding.code = is_known ? known->code : FindingCode::other;
  finding.other = is_known ? "" : name;
}

bool is_misreading(const Finding& finding) {
  return finding.severity == Severity::serious && kind_of(finding.code).rank == Rank::misreading;
}

bool has_misreading(const Findings& findings) {
  return std::any_of(findings.begin(), findings.end(), is_misreading);
}

Findings printed(const Findings& findings) {
  Findings out;
  std::copy_if(findings.begin(), findings.end(), std::back_inserter(out),
               [](const Finding& f) { return !concludes(f.code); });
  return out;
}

void append(Findings& to, const Findings& more) { to.insert(to.end(), more.begin(), more.end()); }

namespace {

std::string in_code(const std::string& word) { return word.empty() ? "" : "`" + word + "`"; }

std::string in_words(Rank rank) {
  return rank == Rank::misreading ? "cause" : rank == Rank::consequence ? "consequence" : "";
}

std::string severities(const FindingKind& kind) {
  const std::string usual = to_string(kind.severity);
  return kind.worst == kind.severity ? usual : usual + " to " + to_string(kind.worst);
}

}  // namespace

std::string finding_table() {
  std::string warnings =
      "| code | severity | status where serious | | meaning |\n|---|---|---|---|---|\n";
  std::string conclusions = "| status | why |\n|---|---|\n";
  for (const FindingKind& kind : kKinds) {
    const std::string effect = in_code(kind.effect == Status::ok ? "" : to_string(kind.effect));
    if (concludes(kind.code)) {
      conclusions += fmt::format("| {} | {} |\n", effect.empty() ? "any" : effect, kind.meaning);
    } else if (kind.code != FindingCode::other) {
      warnings += fmt::format("| `{}` | {} | {} | {} | {} |\n", kind.name, severities(kind), effect,
                              in_words(kind.rank), kind.meaning);
    }
  }
  return warnings + "\n" + conclusions;
}

}  // namespace identikal
