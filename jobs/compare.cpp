// compare: which of several results of one recording, or of several models, is the best?
#include "jobs/compare.h"

#include <algorithm>
#include <filesystem>
#include <memory>

#include "jobs/run.h"
#include "jobs/verbs.h"
#include <fmt/format.h>

#include "identify/optimality/compare_filters.h"
#include "identify/report/console.h"
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

// Results hold no rows: models are ranked on recordings alone.
void refuse_results(const std::vector<std::string>& recordings) {
  for (const std::string& path : recordings) {
    std::error_code neither;
    if (!path.ends_with(".json") && !std::filesystem::is_directory(path, neither)) continue;
    throw InputError({path, 0, 0}, "a result among models",
                     "results only, or models and recordings",
                     "identikal compare A.yaml B.yaml DATA");
  }
}

}  // namespace

Outcome compare_models(const CompareOptions& options, Call& call) {
  Run run{"compare", call, "", {}, options.result};
  RecordingOptions data = options.recordings;
  const auto first_recording =
      std::stable_partition(data.files.begin(), data.files.end(),
                            [&](const std::string& file) { return call.inputs.is_model(file); });
  run.models.assign(data.files.begin(), first_recording);
  data.files.erase(data.files.begin(), first_recording);
  if (data.files.empty()) {
    throw InputError({}, "no recording on the command line",
                     "identikal compare A.yaml B.yaml DATA");
  }
  std::vector<Model> models;
  std::vector<std::vector<Dataset>> recordings;
  Recordings loaded;
  ModelOptions each = options.model;
  refuse_results(data.files);
  for (const std::string& path : run.models) {
    each.file = path;
    models.push_back(load_model(each, run.verb, call.inputs));
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
  add_arguments(verb, "FILES", options->recordings.files,
                "Two or more results (result.json, or its folder), or models and recordings: "
                "A.yaml B.yaml DATA.");
  add_settings(verb, options->model);
  add_range(verb, options->recordings.range);
  add_result(verb, options->result);
  add_filter_choice(verb, options->model);
  verb.run = [options](Call& call) {
    const std::vector<std::string>& files = options->recordings.files;
    const bool models = std::any_of(files.begin(), files.end(), [&](const std::string& file) {
      return call.inputs.is_model(file);
    });
    return models ? compare_models(*options, call) : compare_results_of(*options, call);
  };
  return verb;
}

}  // namespace identikal
