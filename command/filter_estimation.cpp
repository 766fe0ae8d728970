#include "command/filter_estimation.h"

#include <fmt/format.h>

#include "command/quantity.h"
#include "identify/filter/outliers.h"
#include "identify/filter/pictures.h"
#include "identify/filter/recordings_check.h"
#include "lib/base/error.h"

namespace identikal {
namespace {

void validate_on(const std::vector<HeldOut>& held_out, const ModelFile& model,
                 Recordings& recordings, Estimate& estimate) {
  report_hold_out(estimate, model, held_out);
  for (const HeldOut& held : held_out) {
    recordings.held_out.push_back(samples_from(held.recording, held.from));
  }
  for (const Dataset& data : recordings.data) {
    const auto rows = static_cast<long>(data.size());
    estimate.inputs.push_back({data.name, "", rows, rows});
  }
}

}  // namespace

NoiseMlOptions likelihood_options(const SearchOptions& search, const ResultOptions& result,
                                  Progress& progress) {
  NoiseMlOptions options;
  options.starts = static_cast<int>(search.number_of_starts());
  options.seed = static_cast<std::uint64_t>(search.seed);
  options.pictures = wants_pictures(result);
  options.progress = [&progress, starts = options.starts](int start, int iteration, double L) {
    progress.show(fmt::format("start {} of {}, iteration {}, log-likelihood {:.6f}", start, starts,
                              iteration, L));
    return true;
  };
  return options;
}

int estimate_filter(const Run& run, ModelFile model, const RecordingOptions& options,
                    const std::string& held_out, bool reject_outliers, Progress& progress,
                    const FilterEstimator& estimator) {
  Recordings recordings = load_recordings(options, model, run.verb);
  take_period(model, recordings.data.front());
  const std::vector<HeldOut> held =
      hold_out(held_out, model, parse_range(options.range), recordings);
  for (const HeldOut& each : held) {
    check_inputs({each.recording});
    check_period(model, recordings.data.front(), each.recording);
  }
  const auto estimated = [&](const std::vector<Dataset>& data) { return estimator(model, data); };
  Estimate estimate =
      reject_outliers ? tune_robust(model, recordings.data, estimated) : estimated(recordings.data);
  if (!held.empty()) validate_on(held, model, recordings, estimate);
  if (wants_pictures(run.options)) picture_filter(model, recordings.data, estimate);
  progress.clear();
  return finish(run, recordings, estimate);
}

}  // namespace identikal
