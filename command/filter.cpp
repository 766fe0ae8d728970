// filter: which states and innovations has a filter on these recordings?
#include <iostream>
#include <memory>
#include <sstream>

#include "command/run.h"
#include "command/verbs.h"
#include "identify/filter/run.h"
#include "lib/base/error.h"

namespace identikal {
namespace {

struct FilterOptions {
  ModelOptions model;
  RecordingOptions recordings;
  ResultOptions result;
  bool smooth = false;
  long lag = -1;  // below 0: none
};

// States alone, for a program that reads standard input; warnings go where they disturb nobody.
int print_states(const ModelFile& model, const Recordings& recordings, FilterRun& run,
                 bool strict) {
  write_states_csv(std::cout, model, recordings.data, run);
  print("");
  std::vector<Warning>& warnings = run.estimate.warnings;
  warnings.insert(warnings.begin(), recordings.warnings.begin(), recordings.warnings.end());
  for (const Warning& w : warnings) {
    if (w.severity != Severity::note)
      std::cerr << "identikal: " << to_string(w.severity) << ": " << w.text << "\n";
  }
  return exit_code(run.estimate, strict);
}

int filter(const FilterOptions& given, const std::string& command) {
  const Run run{"filter", command, given.model.file, files_of_origin(given.model), given.result};
  if (given.smooth && given.lag >= 0) {
    throw InputError({}, "--smooth and --lag", "one of them",
                     "--smooth takes the whole recording, --lag N what came up to N samples later");
  }
  ModelFile model = load_model(given.model, run.verb);
  require_filter(model, run.verb);
  Recordings recordings = load_recordings(given.recordings, model, run.verb);
  const std::vector<Warning> origin = warnings_of_origin(given.model);
  recordings.warnings.insert(recordings.warnings.begin(), origin.begin(), origin.end());
  take_period(model, recordings.data.front());
  FilterRunOptions options;
  if (given.smooth) options.lag.reset();
  if (given.lag >= 0) options.lag = given.lag;
  FilterRun states = filter_recordings(model, recordings.data, options);
  if (given.result.folder.empty() && !given.result.json) {
    return print_states(model, recordings, states, given.result.strict);
  }
  std::vector<ResultFile> files;
  if (!given.result.folder.empty()) {
    std::ostringstream of_states, of_innovations;
    write_states_csv(of_states, model, recordings.data, states);
    write_innovations_csv(of_innovations, recordings.data, states);
    files.push_back({"states.csv", std::move(of_states).str()});
    files.push_back({"innovations.csv", std::move(of_innovations).str()});
  }
  states.estimate.series = {};  // innovations.csv says the same
  return finish(run, recordings, states.estimate, files);
}

}  // namespace

Verb filter_verb(CLI::App& app) {
  const auto options = std::make_shared<FilterOptions>();
  CLI::App& verb = add_verb(
      app, "filter",
      "Write filtered or smoothed states and innovations as CSV; without -o, print the states.");
  add_model(verb, options->model);
  add_recordings(verb, options->recordings);
  add_flag(verb, "--smooth", options->smooth, "Estimate the states from the whole recording.");
  add_number(verb, "--lag", options->lag, 0, 1000000,
             "Estimate each state from what was recorded up to this many samples later.");
  add_folder(verb, "--from", options->model.from,
             "Take the values that 'tune' or 'fit' has found: the result that -o has written.");
  add_settings(verb, options->model);
  add_range(verb, options->recordings.range);
  add_result(verb, options->result);
  add_quiet(verb, options->result.quiet);
  add_filter_choice(verb, options->model);
  return {"filter", [options](const std::string& command) { return filter(*options, command); }};
}

}  // namespace identikal
