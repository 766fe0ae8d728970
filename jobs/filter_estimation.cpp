#include "jobs/filter_estimation.h"

#include "jobs/quantity.h"
#include <fmt/format.h>

#include "identify/estimate/parameter_table.h"
#include "identify/filter/outliers.h"
#include "identify/filter/pictures.h"
#include "identify/filter/recordings_check.h"
#include "identify/model/components.h"
#include "identify/model/own_parameters.h"
#include "identify/model/row_order.h"
#include "identify/model/sensors.h"
#include "identify/model/simulation_model.h"
#include "lib/base/error.h"

namespace identikal {
namespace {

void validate_on(const std::vector<HeldOut>& held_out, const Model& model, Recordings& recordings,
                 NoiseEstimate& estimate) {
  report_hold_out(estimate, model, held_out);
  for (const HeldOut& held : held_out) {
    recordings.held_out.push_back(samples_from(held.recording, held.from));
  }
  for (const Dataset& data : recordings.data) {
    const auto rows = static_cast<long>(data.size());
    estimate.inputs.push_back({data.name, "", rows, rows});
  }
}

// Rows of a recording have its parameters; another recording's have to be known.
void place_held_out(Model& model, HeldOut& held) {
  if (model.recordings.empty() || !held.recording.own.empty()) return;
  std::vector<Dataset> one{std::move(held.recording)};
  place_recordings(model, one);
  held.recording = std::move(one.front());
}

}  // namespace

bool takes_further_parts(const Model& model) {
  return !model.states.empty() && !model.student && model.recordings.empty() &&
         !rows_have_no_order(model, model.parameters);
}

YamlNode written_out(const Run& run) {
  return with_sensors(with_components(run.call.inputs.model_tree(run.model)));
}

std::function<bool(const ModelExtension& extension)> told_of_parts(const Run& run) {
  return [&run](const ModelExtension& extension) {
    return report_progress(run.call, "trying " + in_words(extension));
  };
}

NoiseMlOptions likelihood_options(const SearchOptions& search, const Run& run) {
  NoiseMlOptions options;
  options.starts = static_cast<int>(search.starts);
  options.iterations = static_cast<int>(search.iterations);
  options.team = run.call.team;
  options.threads = options.team != nullptr ? 1 : static_cast<int>(search.threads);
  options.seed = search.seed_number();
  options.pictures = run.wants_pictures();
  const std::string of = options.starts > 0 ? "of" : "of up to";
  options.progress = [&run, of, starts = search.number_of_starts()](int start, int iteration,
                                                                    double L) {
    // The words take 2 % of a short fit.
    if (!run.call.progress) return may_go_on(run.call);
    const std::string what = fmt::format("start {} {} {}, iteration {}, log-likelihood {:.6f}",
                                         start, of, starts, iteration, L);
    return report_progress(run.call, what, static_cast<double>(start - 1) / starts, L);
  };
  return options;
}

Outcome estimate_filter(const Run& run, Model model, const RecordingOptions& options,
                        const std::string& held_out, bool reject_outliers,
                        const FilterEstimator& estimator, const ModelPreparation& prepare) {
  Recordings recordings = load_recordings(options, model, run.verb, run.call.inputs);
  take_period(model, recordings.data.front());
  model = joint_model(std::move(model), recordings);
  std::vector<HeldOut> held =
      hold_out(held_out, model, parse_range(options.range), recordings, run.call.inputs);
  for (HeldOut& each : held) place_held_out(model, each);
  for (const HeldOut& each : held) {
    check_inputs({each.recording});
    check_period(model, recordings.data.front(), each.recording);
  }
  const Model written = model;
  if (prepare) model = prepare(model, recordings.data);
  const auto estimated = [&](const std::vector<Dataset>& data) { return estimator(model, data); };
  const auto estimate = std::make_shared<NoiseEstimate>(
      reject_outliers ? tune_robust(model, recordings.data, estimated)
                      : estimated(recordings.data));
  if (run.call.team != nullptr && run.call.team->works_for_another()) return {};
  const bool simulation = estimate->objective.method == kSimulationMethod;
  if (simulation) {
    const ParameterSet end = parameters_of(*estimate, model.parameters);
    recordings.data = with_starts(model, end, std::move(recordings.data));
  }
  if (!held.empty()) {
    // Of what is held out nobody knows the start.
    validate_on(held, simulation ? without_process_noise(written) : model, recordings, *estimate);
  }
  if (run.wants_pictures()) picture_filter(model, recordings.data, *estimate);
  return finish(run, recordings, kept(estimate));
}

}  // namespace identikal
