// compare: which of several results of one recording, or of several models, is the best?
#include "jobs/compare.h"

#include <algorithm>
#include <iterator>
#include <memory>

#include "jobs/run.h"
#include "jobs/verbs.h"
#include <fmt/format.h>

#include "identify/optimality/compare_filters.h"
#include "identify/report/console.h"
#include "identify/result/estimated_model.h"
#include "identify/result/file.h"
#include "identify/result/json.h"
#include "identify/validation/compare_results.h"
#include "lib/base/error.h"

namespace identikal {
namespace {

Outcome compare_results_of(const CompareOptions& options, Call& call) {
  const Run run{"compare", call, "", {}, options.result};
  for (const auto& [given, name] : {std::pair{!options.model.settings.empty(), "--set"},
                                    std::pair{!options.model.filter.empty(), "--filter"},
                                    std::pair{!options.recordings.range.empty(), "--range"},
                                    std::pair{!options.result.folder.empty(), "-o"}}) {
    if (!given) continue;
    throw InputError({}, fmt::format("{} does not apply to results", name),
                     "identikal compare A.yaml B.yaml DATA");
  }
  std::vector<StoredResult> results;
  for (const std::string& path : options.recordings.files) {
    results.push_back(call.inputs.result(path));
  }
  return outcome_of(run, kept(std::make_shared<Comparison>(compare_results(results))));
}

// The model of a result with its estimates, by the name that it was given.
Model model_of_result(const std::string& path, const CompareOptions& options, Run& run) {
  for (const auto& [given, name] : {std::pair{!options.model.settings.empty(), "--set"},
                                    std::pair{!options.model.filter.empty(), "--filter"}}) {
    if (!given) continue;
    throw InputError({path, 0, 0}, fmt::format("{} does not apply to results", name), "model files",
                     "'export --to yaml' writes the model of a result");
  }
  const StoredResult result = run.call.inputs.result(path);
  const std::vector<std::string> files = files_of(result, path);
  run.read.insert(run.read.end(), files.begin(), files.end());
  Model out = estimated_model(result.estimate, result.path);
  out.source = path;
  return out;
}

}  // namespace

Outcome compare_models(const CompareOptions& options, Call& call) {
  Run run{"compare", call, "", {}, options.result};
  RecordingOptions data = options.recordings;
  const auto first_recording =
      std::stable_partition(data.files.begin(), data.files.end(), [&](const std::string& file) {
        return call.inputs.is_model(file) || call.inputs.is_result(file);
      });
  const std::vector<std::string> compared(data.files.begin(), first_recording);
  data.files.erase(data.files.begin(), first_recording);
  std::copy_if(compared.begin(), compared.end(), std::back_inserter(run.models),
               [&](const std::string& file) { return call.inputs.is_model(file); });
  if (data.files.empty()) {
    throw InputError({}, "no recording on the command line",
                     "identikal compare A.yaml B.yaml DATA");
  }
  std::vector<Model> models;
  std::vector<std::vector<Dataset>> recordings;
  Recordings loaded;
  ModelOptions each = options.model;
  for (const std::string& path : compared) {
    each.file = path;
    models.push_back(call.inputs.is_model(path) ? load_model(each, run.verb, call.inputs)
                                                : model_of_result(path, options, run));
    loaded = load_recordings(data, models.back(), run.verb, call.inputs);
    take_period(models.back(), loaded.data.front());
    recordings.push_back(loaded.data);
  }
  const auto estimate = std::make_shared<Comparison>(compare_filters(models, recordings));
  return finish(run, loaded, kept(estimate));
}

Verb compare_verb() {
  const auto options = std::make_shared<CompareOptions>();
  Verb verb{
      "compare",
      "Rank results of one recording (AIC, BIC, likelihood ratios of nested models), or models by "
      "their likelihood on recordings."};
  add_arguments(
      verb, "FILES", options->recordings.files,
      "Two or more results (result.json, or its folder), or models, results and recordings: "
      "A.yaml RESULT DATA.");
  add_settings(verb, options->model);
  add_range(verb, options->recordings.range);
  add_result(verb, options->result);
  add_filter_choice(verb, options->model);
  verb.run = [options](Call& call) {
    const std::vector<std::string>& files = options->recordings.files;
    const bool models = std::any_of(files.begin(), files.end(), [&](const std::string& file) {
      return call.inputs.is_model(file) || call.inputs.is_recording(file);
    });
    return models ? compare_models(*options, call) : compare_results_of(*options, call);
  };
  return verb;
}

}  // namespace identikal
