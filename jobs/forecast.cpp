// forecast: what will the outputs be behind the last row, and between which values?
#include "identify/filter/forecast.h"

#include <algorithm>
#include <memory>
#include <optional>
#include <sstream>
#include <utility>

#include "jobs/run.h"
#include "jobs/verbs.h"
#include <fmt/format.h>

#include "identify/simulation/scenarios.h"
#include "lib/base/error.h"

namespace identikal {
namespace {

struct ForecastOptions {
  ModelOptions model;
  RecordingOptions recordings;
  ResultOptions result;
  std::int64_t rows = 0, scenarios = 0, seed = -1;
  std::string inputs;
};

// Its first and last rows, for people.
void add_table(const Forecast& forecast, Estimate& out) {
  constexpr Eigen::Index kShown = 12;
  for (Eigen::Index i = 0; i < forecast.mean.rows(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    for (Eigen::Index t = 0; t < std::min(kShown, forecast.time.size()); ++t) {
      out.notes.push_back(fmt::format("{:<10} {:>12.6g} s {:>12.6g} +- {:<9.3g} {}",
                                      forecast.names[at], forecast.time[t], forecast.mean(i, t),
                                      forecast.sd(i, t), forecast.units[at]));
    }
    if (forecast.time.size() > kShown) {
      out.notes.push_back(
          fmt::format("and {} more rows of {}", forecast.time.size() - kShown, forecast.names[at]));
    }
  }
}

void refuse_options(const ForecastOptions& given, const Model& model) {
  if (given.rows < 1) {
    throw InputError({}, "the number of rows to forecast is missing", "-n ROWS");
  }
  if (!given.inputs.empty() && model.inputs.empty()) {
    throw InputError({}, "--inputs does not apply to this model", "a model with inputs");
  }
  if (given.seed >= 0 && given.scenarios == 0) {
    throw InputError({}, "--seed does not apply", "--scenarios N with it");
  }
}

void refuse_several(const Recordings& recordings) {
  if (recordings.data.size() == 1) return;
  throw InputError({recordings.data.back().name, 0, 0},
                   fmt::format("{} runs", recordings.data.size()), "one run, which is gone on from",
                   "select rows with --range");
}

// Rows as CSV on standard output; findings go to standard error.
Outcome table_alone(const OutputForecast& estimate, std::string csv, bool strict, Call& call) {
  for (const Finding& f : printed(estimate.findings)) {
    if (f.severity != Severity::note) notice(call, to_string(f.severity) + ": " + f.text);
  }
  Outcome out;
  out.text = std::move(csv);
  out.exit_code = exit_code(estimate, strict);
  return out;
}

// The scenarios as CSV, printed in place of the forecast or, with -o, written alongside.
std::string scenarios_text(const ForecastOptions& given, const Model& model,
                           const Dataset& recording, const Dataset* future) {
  const auto seed = static_cast<std::uint64_t>(given.seed >= 0 ? given.seed : 1);
  std::ostringstream csv;
  write_scenarios_csv(csv, simulate_scenarios(model, recording, given.rows,
                                              static_cast<int>(given.scenarios), seed, future));
  return std::move(csv).str();
}

Outcome forecast_ahead(const ForecastOptions& given, Call& call) {
  std::vector<std::string> read = files_of_origin(given.model, call.inputs);
  if (!given.inputs.empty()) read.push_back(given.inputs);
  const Run run{"forecast", call, given.model.file, read, given.result};
  Model model = load_model(given.model, run.verb, call.inputs);
  require_filter(model, run.verb);
  refuse_options(given, model);
  Recordings recordings = load_recordings(given.recordings, model, run.verb, call.inputs);
  refuse_several(recordings);
  const Findings origin = findings_of_origin(given.model, call.inputs);
  recordings.findings.insert(recordings.findings.begin(), origin.begin(), origin.end());
  take_period(model, recordings.data.front());
  model = model_of_recording(std::move(model), recordings.data.front());
  model = going_on_from_rows_before(std::move(model), given.recordings, recordings, call.inputs);
  std::optional<Dataset> future;
  if (!given.inputs.empty()) {
    future = load_data(read_files(given.inputs, call.inputs), model, {}, false);
  }
  const auto estimate = std::make_shared<OutputForecast>(
      forecast(model, recordings.data.front(), given.rows, future ? &*future : nullptr));
  std::ostringstream csv;
  write_forecast_csv(csv, estimate->forecast);
  const std::string scenarios =
      given.scenarios > 0
          ? scenarios_text(given, model, recordings.data.front(), future ? &*future : nullptr)
          : "";
  if (given.result.folder.empty() && !given.result.json) {
    return table_alone(*estimate, given.scenarios > 0 ? scenarios : std::move(csv).str(),
                       given.result.strict, call);
  }
  add_table(estimate->forecast, *estimate);
  std::vector<ResultFile> files;
  if (!given.result.folder.empty()) {
    files.push_back({"forecast.csv", std::move(csv).str()});
    if (given.scenarios > 0) files.push_back({"scenarios.csv", scenarios});
  }
  return finish(run, recordings, kept(estimate), files);
}

}  // namespace

Verb forecast_verb() {
  const auto options = std::make_shared<ForecastOptions>();
  Verb verb{
      "forecast",
      "Forecast the outputs behind the last row, with intervals, as CSV; with -o, as a result "
      "too."};
  add_model(verb, options->model);
  add_recordings(verb, options->recordings);
  add_number(verb, "-n,--rows", options->rows, 1, 1000000, "How many rows to forecast.");
  add_number(verb, "--scenarios", options->scenarios, 1, 100000,
             "Draw so many ways that the outputs may go; printed in place of the forecast, with -o "
             "written to scenarios.csv.");
  add_seed(verb, options->seed, "Seed of the scenarios.", "1");
  add_file(verb, "--inputs", options->inputs, "Recording that holds the inputs of these rows.");
  add_folder(verb, "--from", options->model.from,
             "Take the values that 'tune' or 'fit' has found: the result that -o has written.");
  add_settings(verb, options->model);
  add_range(verb, options->recordings.range);
  add_result(verb, options->result);
  add_quiet(verb, options->result.quiet);
  add_filter_choice(verb, options->model);
  verb.run = [options](Call& call) { return forecast_ahead(*options, call); };
  return verb;
}

}  // namespace identikal
