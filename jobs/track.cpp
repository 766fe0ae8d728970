// track: what are the noise, the coefficients or the tyres sample by sample?
#include "identify/noise/track.h"

#include <memory>

#include "jobs/run.h"
#include "jobs/track_settings.h"
#include "jobs/verbs.h"
#include <fmt/format.h>

#include "identify/regression/track.h"
#include "identify/vehicle/track.h"
#include "lib/base/error.h"

namespace identikal {
namespace {

struct TrackOptions {
  ModelOptions model;
  RecordingOptions recordings;
  ResultOptions result;
  bool adaptive = false;
  std::int64_t particles = 0;
  std::int64_t seed = 1, seconds = 0;
};

void check_options(const TrackOptions& options, const Model& model) {
  if (is_formula_model(model)) require_linear(model, "track");
  const bool noise = is_linear(model);
  if (noise || (!options.adaptive && options.particles == 0)) return;
  throw InputError({},
                   fmt::format("{} does not apply to this model",
                               options.adaptive ? "--adaptive" : "--particles"),
                   "a model with A, C, Q, R", "the model file says how the past is forgotten");
}

TrackedNoise track_noise(const TrackOptions& given, const Dataset& recording, const Call& call,
                         TrackSettings& settings) {
  NoiseTrackOptions options;
  options.adaptive = given.adaptive;
  if (given.particles > 0) options.draws = given.particles;
  options.seed = static_cast<std::uint64_t>(given.seed);
  settings.noise = options;
  options.progress = [&](Eigen::Index sample, Eigen::Index of) {
    if (sample % 100 != 0) return true;
    const double share = static_cast<double>(sample) / static_cast<double>(of);
    return report_progress(call, fmt::format("sample {} of {}", sample, of), share);
  };
  return track(settings.model, recording, options);
}

TrackedCoefficients track_coefficients(const Dataset& recording, const Call& call,
                                       TrackSettings& settings) {
  return track_regression(
      settings.model, recording,
      [&](const std::string& what) { return report_progress(call, what); },
      &settings.regression.emplace());
}

// A row per sample, as the result's course has it.
void add_course(const TimeHistory& course, Outcome& out) {
  out.series.push_back({"tracked", course.mean.transpose()});
  out.series.push_back({"tracked_sd", course.sd.transpose()});
}

Outcome track_recording(const TrackOptions& options, Call& call) {
  limit_time(call, options.seconds);
  const Run run{"track", call, options.model.file, {}, options.result};
  Model model = load_any_model(options.model, call.inputs);
  check_options(options, model);
  const Recordings recordings = load_recordings(options.recordings, model, run.verb, call.inputs);
  const Dataset& recording = recordings.data.front();
  take_period(model, recording);
  const auto finished = [&](auto estimate) {
    const auto shared = std::make_shared<decltype(estimate)>(std::move(estimate));
    Outcome out = finish(run, recordings, kept(shared));
    if (call.wants_series) add_course(shared->time_history, out);
    return out;
  };
  if (is_vehicle(model)) return finished(track_vehicle(model, recording));
  const auto settings = std::make_shared<TrackSettings>();
  settings->model = model;
  Outcome out = is_regression(model) ? finished(track_coefficients(recording, call, *settings))
                                     : finished(track_noise(options, recording, call, *settings));
  out.track = settings;
  return out;
}

}  // namespace

Verb track_verb() {
  const auto options = std::make_shared<TrackOptions>();
  Verb verb{
      "track",
      "Estimate sample by sample: Q and R of a filter, a regression's coefficients, a vehicle."};
  add_model(verb, options->model);
  options->recordings.files.resize(1);
  add_argument(verb, "DATA", options->recordings.files.front(), "Recording (CSV).");
  add_settings(verb, options->model);
  add_range(verb, options->recordings.range);
  add_result_with_page(verb, options->result);
  add_flag(verb, "--adaptive", options->adaptive,
           "Start with the noise of the model file and re-estimate it whenever a change is found.");
  add_number(verb, "--particles", options->particles, 10, 1000000,
             "Number of filters that run in parallel.", "400");
  add_old_number(verb, "--draws", "--particles", options->particles, 10, 1000000);
  add_seed(verb, options->seed, "Seed of the particles.");
  add_time_limit(verb, options->seconds);
  verb.run = [options](Call& call) { return track_recording(*options, call); };
  return verb;
}

}  // namespace identikal
