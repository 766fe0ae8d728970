// filter: which states and innovations has a filter on these recordings?
#include <functional>
#include <memory>
#include <sstream>
#include <utility>

#include "jobs/quantity.h"
#include "jobs/run.h"
#include "jobs/verbs.h"
#include <fmt/format.h>

#include "identify/filter/model_filter.h"
#include "identify/filter/observation_weights.h"
#include "identify/filter/run.h"
#include "identify/filter/smoothed_noise.h"
#include "lib/base/error.h"

namespace identikal {
namespace {

struct FilterOptions {
  ModelOptions model;
  RecordingOptions recordings;
  ResultOptions result;
  bool smooth = false;
  std::int64_t lag = -1;  // below 0: none
  std::int64_t skip_first = 0;
  std::int64_t trajectories = 0, seed = -1;
  std::string weights;  // the time of a row
};

// States alone, for a program that reads standard input; warnings go where they disturb nobody.
Outcome states_alone(const Run& run, const Model& model, const Recordings& recordings,
                     const StateEstimate& states) {
  std::ostringstream csv;
  write_states_csv(csv, model, recordings.data, states);
  for (const Findings* findings : {&recordings.findings, &states.findings}) {
    for (const Finding& f : printed(*findings)) {
      if (f.severity == Severity::note) continue;
      notice(run.call, to_string(f.severity) + ": " + f.text);
    }
  }
  Outcome out;
  out.text = std::move(csv).str();
  out.exit_code = exit_code(states, run.options.strict);
  return out;
}

// A row per sample, recordings one after the other, in SI.
void add_states(const StateEstimate& states, Outcome& out) {
  Eigen::Index rows = 0;
  for (const SmootherResult& each : states.states) rows += each.x.cols();
  const Eigen::Index n = states.states.front().x.rows();
  NamedSeries x{"states", {}}, sd{"state_sd", {}};
  x.values.resize(rows, n);
  sd.values.resize(rows, n);
  Eigen::Index row = 0;
  for (const SmootherResult& each : states.states) {
    x.values.middleRows(row, each.x.cols()) = each.x.transpose();
    sd.values.middleRows(row, each.x.cols()) = each.sd.transpose();
    row += each.x.cols();
  }
  out.series.push_back(std::move(x));
  out.series.push_back(std::move(sd));
}

void check_options(const FilterOptions& given) {
  if (given.smooth && given.lag >= 0) {
    throw InputError({}, "--smooth and --lag", "one of them",
                     "--smooth takes the whole recording, --lag N what came up to N samples later");
  }
  if (given.trajectories > 0 && (!given.smooth || given.result.folder.empty())) {
    throw InputError({}, "--trajectories alone", "--smooth and -o FOLDER with it",
                     "they are drawn given the whole recording, and written to trajectories.csv");
  }
  if (!given.weights.empty() && given.result.folder.empty()) {
    throw InputError({}, "--weights alone", "-o FOLDER with it", "they are written to weights.csv");
  }
  if (given.seed >= 0 && given.trajectories == 0) {
    throw InputError({}, "--seed does not apply", "--trajectories N with it");
  }
}

// The row nearest to a time after the first row.
Eigen::Index row_at(const std::string& text, const Dataset& data) {
  const double after = quantity("--weights", text, "s");
  const double longest = data.time[data.size() - 1] - data.time[0];
  if (!(after >= 0.0 && after <= longest + data.dt)) {
    throw InputError({data.name, 0, 0}, "--weights " + text,
                     fmt::format("0 to {:.6g} s after the first row", longest));
  }
  Eigen::Index row = 0;
  (data.time.array() - data.time[0] - after).abs().minCoeff(&row);
  return row;
}

using Write = std::function<void(std::ostream&)>;

ResultFile file_of(const char* name, const Write& write) {
  std::ostringstream text;
  write(text);
  return {name, std::move(text).str()};
}

std::vector<ResultFile> files_of(const FilterOptions& given, const Model& model,
                                 const std::vector<Dataset>& recordings,
                                 const StateEstimate& states) {
  std::vector<ResultFile> out{
      file_of("states.csv",
              [&](std::ostream& to) { write_states_csv(to, model, recordings, states); }),
      file_of("innovations.csv",
              [&](std::ostream& to) { write_innovations_csv(to, recordings, states); }),
      file_of("predictions.csv",
              [&](std::ostream& to) { write_predictions_csv(to, recordings, states); })};
  if (given.smooth && !model.student && has_disturbance_smoother(model)) {
    out.push_back(file_of("disturbances.csv", [&](std::ostream& to) {
      write_disturbances_csv(to, model, recordings);
    }));
  }
  if (!given.weights.empty()) {
    if (recordings.size() > 1) {
      throw InputError({}, "--weights of several recordings", "one recording");
    }
    std::optional<Eigen::Index> lag = given.lag >= 0 ? given.lag : 0;
    if (given.smooth) lag.reset();
    const ObservationWeights weights =
        observation_weights(model, recordings[0], row_at(given.weights, recordings[0]), lag);
    out.push_back(file_of("weights.csv", [&](std::ostream& to) {
      write_weights_csv(to, model, recordings[0], weights);
    }));
  }
  if (given.trajectories > 0) {
    const auto seed = static_cast<std::uint64_t>(given.seed >= 0 ? given.seed : 1);
    out.push_back(file_of("trajectories.csv", [&](std::ostream& to) {
      write_trajectories_csv(to, model, recordings, static_cast<int>(given.trajectories), seed);
    }));
  }
  return out;
}

Outcome filter(const FilterOptions& given, Call& call) {
  const Run run{"filter", call, given.model.file, files_of_origin(given.model, call.inputs),
                given.result};
  check_options(given);
  Model model = load_model(given.model, run.verb, call.inputs);
  require_filter(model, run.verb);
  Recordings recordings = load_recordings(given.recordings, model, run.verb, call.inputs);
  const Findings origin = findings_of_origin(given.model, call.inputs);
  recordings.findings.insert(recordings.findings.begin(), origin.begin(), origin.end());
  take_period(model, recordings.data.front());
  model = joint_model(std::move(model), recordings);
  model = going_on_from_rows_before(std::move(model), given.recordings, recordings, call.inputs);
  FilterRunOptions options;
  if (given.smooth) options.lag.reset();
  if (given.lag >= 0) options.lag = given.lag;
  options.skip_first = given.skip_first;
  options.by_row = !given.result.folder.empty();
  StateEstimate states = filter_recordings(model, recordings.data, options);
  if (given.result.folder.empty() && !given.result.json) {
    return states_alone(run, model, recordings, states);
  }
  std::vector<ResultFile> files;
  if (!given.result.folder.empty()) files = files_of(given, model, recordings.data, states);
  const Series innovations = std::exchange(states.series, {});  // innovations.csv says it
  const auto estimate = std::make_shared<StateEstimate>(std::move(states));
  Outcome out = finish(run, recordings, kept(estimate), files);
  if (call.wants_series) {
    add_series(innovations, out);
    add_states(*estimate, out);
  }
  return out;
}

}  // namespace

Verb filter_verb() {
  const auto options = std::make_shared<FilterOptions>();
  Verb verb{
      "filter",
      "Write filtered or smoothed states and innovations as CSV; without -o, print the states."};
  add_model(verb, options->model);
  add_recordings(verb, options->recordings);
  add_flag(verb, "--smooth", options->smooth, "Estimate the states from the whole recording.");
  add_number(verb, "--lag", options->lag, 0, 1000000,
             "Estimate each state from what was recorded up to this many samples later.");
  add_number(verb, "--skip-first", options->skip_first, 0, 1000000,
             "Leave this many rows of every recording out of the log-likelihood, given them.");
  add_text(verb, "--weights", options->weights,
           "With -o: say how much each measured sample counts for the states so long after the "
           "first row, e.g. 10s.");
  add_number(
      verb, "--trajectories", options->trajectories, 1, 100000,
      "With --smooth and -o: draw so many trajectories of the states, given the whole recording.");
  add_seed(verb, options->seed, "Seed of the trajectories.", "1");
  add_folder(verb, "--from", options->model.from,
             "Take the values that 'tune' or 'fit' has found: the result that -o has written.");
  add_settings(verb, options->model);
  add_range(verb, options->recordings.range);
  add_result(verb, options->result);
  add_quiet(verb, options->result.quiet);
  add_filter_choice(verb, options->model);
  verb.run = [options](Call& call) { return filter(*options, call); };
  return verb;
}

}  // namespace identikal
