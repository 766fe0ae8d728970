// shape: is the noise coloured, and which shaping filter makes it?
#include "identify/colour/shape.h"

#include <memory>

#include <fmt/format.h>

#include "command/quantity.h"
#include "command/run.h"
#include "command/verbs.h"
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
  long order = 4;
  std::int64_t seed = 1;
};

ShapeOptions shape_options(const ShapingOptions& given, Progress& progress) {
  ShapeOptions out;
  out.most_order = static_cast<int>(given.order);
  out.seed = static_cast<std::uint64_t>(given.seed);
  if (given.noise == "process") out.source = NoiseSource::process;
  if (given.noise == "measurement") out.source = NoiseSource::measurement;
  out.hold_out = hold_out_share(given.hold_out);
  out.progress = [&](const std::string& what) {
    progress.show(what);
    return true;
  };
  return out;
}

// The spectra, and the models that the filter's states have joined.
std::vector<ResultFile> files_of(const ModelFile& model, ShapeResult& result) {
  std::vector<ResultFile> files{{"spectrum.csv", spectrum_csv(result.estimate)}};
  if (result.model) {
    const Shaping& s = *result.estimate.shaping;
    const std::string text = model_text(
        *result.model, {fmt::format("{} with a shaping filter of order {} in its {} noise, tuned.",
                                    model.name, s.order, s.noise_source),
                        "The first states are the filter's."});
    files.push_back({"shaped.yaml", text});
    result.estimate.model_file = {"shaped.yaml", sha256_of_text(text), text, {}};
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

int shape_noise(const ShapingOptions& options, const std::string& command) {
  const Run run{"shape", command, options.model.file, {}, options.result};
  ModelFile model = load_model(options.model, run.verb);
  require_linear(model, run.verb);
  Progress progress(options.result.quiet);
  const ShapeOptions of_search = shape_options(options, progress);
  const Recordings recordings = load_recordings(options.recordings, model, run.verb);
  take_period(model, recordings.data.front());
  ShapeResult result = shape(model, recordings.data, of_search);
  progress.clear();
  if (wants_pictures(options.result)) {
    picture_filter(result.model ? *result.model : model, recordings.data, result.estimate);
  }
  const std::vector<ResultFile> files = files_of(model, result);
  return finish(run, recordings, result.estimate, files);
}

}  // namespace

Verb shape_verb(CLI::App& app) {
  const auto options = std::make_shared<ShapingOptions>();
  CLI::App& verb = add_verb(app, "shape", "Detect coloured noise and fit a shaping filter.");
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
  return {"shape",
          [options](const std::string& command) { return shape_noise(*options, command); }};
}

}  // namespace identikal
