// info: what is in these recordings?
#include <algorithm>
#include <chrono>
#include <memory>
#include <optional>

#include "jobs/quantity.h"
#include "jobs/run.h"
#include <fmt/format.h>

#include "command/table_text.h"
#include "command/verbs.h"
#include "identify/report/survey_text.h"
#include "identify/result/json.h"
#include "identify/survey/columns.h"
#include "identify/survey/survey.h"
#include "lib/base/error.h"
#include "lib/data/join.h"

namespace identikal {
namespace {

struct InfoOptions {
  std::vector<std::string> files;  // a model among them, or none
  std::string range;
  bool vehicle = false, json = false, model = false;
};

SurveyReport surveyed(const std::vector<Table>& files, const std::optional<Model>& model,
                      const TimeRange& range, Inputs& inputs) {
  SurveyReport estimate;
  estimate.verb = "info";
  Recordings records;
  if (model) {
    estimate.model_name = model->name;
    records.add(load_runs(files, *model, range), files, range, inputs);
    estimate.survey = survey(vehicle_signals(*model, records.data));
  } else {
    Dataset whole;
    whole.time = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(files[0].rows));
    records.add({std::move(whole)}, files, range, inputs);
    estimate.survey = survey(within(guess_vehicle(files), range));
  }
  estimate.inputs = records.records;
  estimate.notes = records.data[0].notes;
  conclude(estimate, "surveyed", Basis::tests);
  return estimate;
}

// A survey of each recording, as a person or a program reads it.
Outcome survey_vehicles(const InfoOptions& options, const std::optional<Model>& model,
                        const std::vector<std::string>& recordings, Inputs& inputs) {
  const bool one = options.json || options.model;
  if (one && recordings.size() > 1) {
    throw InputError({},
                     fmt::format("{} recordings with {}", recordings.size(),
                                 options.json ? "--json" : "--model"),
                     "one");
  }
  if (options.model && (model || options.json)) {
    throw InputError({}, fmt::format("--model with {}", model ? "a model file" : "--json"),
                     "--model with a recording alone", "it proposes a model file");
  }
  if (model && !is_vehicle(*model)) {
    throw InputError({model->source, 0, 0}, "--vehicle with a linear model", "model: single-track");
  }
  Outcome out;
  for (const std::string& argument : recordings) {
    const auto begin = std::chrono::steady_clock::now();
    const SurveyReport estimate =
        surveyed(read_files(argument, inputs), model, parse_range(options.range), inputs);
    if (options.json) {
      const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
      out.text += result_json(sections_of(estimate), false, took.count());
    } else if (options.model) {
      out.text += proposed_model(estimate.survey, argument);
    } else {
      for (const std::string& note : estimate.notes) out.text += note + "\n";
      out.text += argument + "\n" + survey_text(estimate.survey);
    }
  }
  return out;
}

std::string columns_text(const std::string& argument, const std::optional<Model>& model,
                         const TimeRange& range, Inputs& inputs) {
  std::string text;
  const std::vector<Table> files = read_files(argument, inputs);
  for (const Table& table : files) text += table_text(table);
  if (model) {
    const Dataset data = load_data(files, *model, range);
    for (const auto* notes : {&data.notes, &data.unknown_units}) {
      for (const std::string& note : *notes) text += note + "\n";
    }
    text += channels_text(*model, data);
  } else if (files.size() > 1) {
    for (const std::string& note : join_tables(files, {}).notes) text += note + "\n";
  }
  return text;
}

Outcome info(const InfoOptions& options, Call& call) {
  Inputs& inputs = call.inputs;
  std::vector<std::string> recordings = options.files;
  std::optional<Model> model;
  if (const auto file =
          std::find_if(recordings.begin(), recordings.end(),
                       [&](const std::string& name) { return inputs.is_model(name); });
      file != recordings.end()) {
    model = parse_model_file(inputs.model_text(*file), *file);
    recordings.erase(file);
  }
  if (recordings.empty()) {
    throw InputError({}, "no recording on the command line", "identikal info [MODEL] DATA");
  }
  if (options.vehicle) return survey_vehicles(options, model, recordings, inputs);
  if (options.json) throw InputError({}, "--json without --vehicle", "info --vehicle DATA --json");
  if (options.model) {
    throw InputError({}, "--model without --vehicle", "info --vehicle DATA --model");
  }
  if (!model && !options.range.empty()) {
    throw InputError({}, "--range does not apply to columns", "a model file, or --vehicle",
                     "identikal info MODEL DATA --range FROM:TO");
  }
  Outcome out;
  for (const std::string& argument : recordings) {
    out.text += columns_text(argument, model, parse_range(options.range), inputs);
  }
  return out;
}

}  // namespace

Verb info_verb() {
  const auto options = std::make_shared<InfoOptions>();
  Verb verb{"info", "Show the columns, units, rates and gaps of a recording."};
  add_arguments(verb, "FILES", options->files,
                "Recordings (CSV), after a model file (YAML) or not.");
  add_range(verb, options->range);
  add_flag(verb, "--vehicle", options->vehicle,
           "Survey a vehicle's recording: signs, units, clocks, what can be identified.");
  add_flag(verb, "--json", options->json, "With --vehicle: Print the survey as JSON.");
  add_flag(verb, "--model", options->model,
           "With --vehicle: Print the model file that the survey proposes, to be completed.");
  verb.run = [options](Call& call) { return info(*options, call); };
  return verb;
}

}  // namespace identikal
