// shape: is the noise coloured, and which shaping filter makes it?
#include "identify/colour/shape.h"

#include <memory>

#include "jobs/quantity.h"
#include "jobs/run.h"
#include "jobs/verbs.h"
#include <fmt/format.h>

#include "identify/filter/pictures.h"
#include "identify/result/csv.h"
#include "identify/result/estimated_model.h"
#include "identify/result/file_digest.h"

namespace identikal {
namespace {

struct ShapingOptions {
  ModelOptions model;
  RecordingOptions recordings;
  ResultOptions result;
  std::string noise = "both", hold_out = "30%";
  std::int64_t order = 4;
  std::int64_t seed = 1, seconds = 0;
};

ShapeOptions shape_options(const ShapingOptions& given, const Call& call) {
  ShapeOptions out;
  out.most_order = static_cast<int>(given.order);
  out.seed = static_cast<std::uint64_t>(given.seed);
  if (given.noise == "process") out.source = NoiseSource::process;
  if (given.noise == "measurement") out.source = NoiseSource::measurement;
  out.hold_out = hold_out_share(given.hold_out);
  out.progress = [&](const std::string& what) { return report_progress(call, what); };
  return out;
}

constexpr const char* kShapedModel = "shaped.yaml";

// The spectra, and the models that the filter's states have joined.
std::vector<ResultFile> files_of(const Model& model, const ShapeResult& result) {
  std::vector<ResultFile> files{{"spectrum.csv", spectrum_csv(result.estimate.shaping)}};
  if (result.model) {
    const Shaping& s = result.estimate.shaping;
    std::string text = model_text(
        *result.model, {fmt::format("{} with a shaping filter of order {} in its {} noise, tuned.",
                                    model.name, s.order, s.noise_source),
                        "The first states are the filter's."});
    files.push_back({kShapedModel, std::move(text)});
  }
  if (result.in_measurement) {
    files.push_back(
        {"shaped_measurement.yaml",
         model_text(
             *result.in_measurement,
             {"The model of shaped.yaml with its shaping filter in the measurement noise instead:",
              "exactly the same outputs and likelihood, other states. Outputs alone do not "
              "determine",
              "which of the two is right. The first states are the filter's."})});
  }
  return files;
}

Outcome shape_noise(const ShapingOptions& options, Call& call) {
  limit_time(call, options.seconds);
  const Run run{"shape", call, options.model.file, {}, options.result};
  Model model = load_model(options.model, run.verb, call.inputs);
  require_linear(model, run.verb);
  const ShapeOptions of_search = shape_options(options, call);
  const Recordings recordings = load_recordings(options.recordings, model, run.verb, call.inputs);
  take_period(model, recordings.data.front());
  ShapeResult result = shape(model, recordings.data, of_search);
  if (run.wants_pictures()) {
    picture_filter(result.model ? *result.model : model, recordings.data, result.estimate);
  }
  const std::vector<ResultFile> files = files_of(model, result);
  KeptResult shaped = kept(std::make_shared<ShapingEstimate>(std::move(result.estimate)));
  if (result.model) {
    const std::string& text = files[1].content;
    shaped.take({kShapedModel, sha256_of_text(text), text, {}});
  }
  return finish(run, recordings, std::move(shaped), files);
}

}  // namespace

Verb shape_verb() {
  const auto options = std::make_shared<ShapingOptions>();
  Verb verb{"shape", "Detect coloured noise and fit a shaping filter."};
  add_model(verb, options->model);
  add_recordings(verb, options->recordings);
  add_settings(verb, options->model);
  add_range(verb, options->recordings.range);
  add_result_with_page(verb, options->result);
  add_choice(verb, "--noise", options->noise, {"both", "process", "measurement"},
             "Choose the noise that may be coloured.");
  add_number(verb, "--order", options->order, 1, 4, "Highest order of a shaping filter.");
  add_text(verb, "--hold-out", options->hold_out,
           "Hold out the last share of each recording to compare the filters on.");
  add_seed(verb, options->seed, "Seed of the random starts.");
  add_time_limit(verb, options->seconds);
  verb.run = [options](Call& call) { return shape_noise(*options, call); };
  return verb;
}

}  // namespace identikal
