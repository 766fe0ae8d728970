// info: what is in these recordings?
#include <algorithm>
#include <memory>
#include <optional>

#include <fmt/format.h>

#include "command/quantity.h"
#include "command/run.h"
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
  bool vehicle = false, json = false;
};

Estimate surveyed(const std::vector<Table>& files, const std::optional<ModelFile>& model,
                  const TimeRange& range) {
  Estimate estimate;
  estimate.verb = "info";
  estimate.status = Status::ok;
  estimate.message = "surveyed";
  Recordings records;
  if (model) {
    estimate.model_name = model->name;
    records.add(load_runs(files, *model, range), files, range);
    estimate.survey = survey(vehicle_signals(*model, records.data));
  } else {
    Dataset whole;
    whole.time = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(files[0].rows));
    records.add({std::move(whole)}, files, range);
    estimate.survey = survey(within(guess_vehicle(files), range));
  }
  estimate.inputs = records.records;
  estimate.notes = records.data[0].notes;
  return estimate;
}

// A survey of each recording, as a person or a program reads it.
int survey_vehicles(const InfoOptions& options, const std::optional<ModelFile>& model,
                    const std::vector<std::string>& recordings) {
  if (options.json && recordings.size() > 1) {
    throw InputError({}, fmt::format("{} recordings with --json", recordings.size()), "one");
  }
  if (model && model->form != ModelFile::Form::single_track) {
    throw InputError({model->path, 0, 0}, "--vehicle with a linear model", "model: single-track");
  }
  for (const std::string& argument : recordings) {
    const Run run{"info", "", "", {}, {}};
    const Estimate estimate = surveyed(read_files(argument), model, parse_range(options.range));
    if (options.json) {
      print(result_json(estimate, false, run.seconds()));
    } else {
      for (const std::string& note : estimate.notes) print(note + "\n");
      print(argument + "\n" + survey_text(*estimate.survey));
    }
  }
  return 0;
}

std::string columns_text(const std::string& argument, const std::optional<ModelFile>& model,
                         const TimeRange& range) {
  std::string text;
  const std::vector<Table> files = read_files(argument);
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

int info(const InfoOptions& options) {
  std::vector<std::string> recordings = options.files;
  std::optional<ModelFile> model;
  if (const auto file = std::find_if(recordings.begin(), recordings.end(), is_model);
      file != recordings.end()) {
    model = read_model_file(*file);
    recordings.erase(file);
  }
  if (recordings.empty()) {
    throw InputError({}, "no recording on the command line", "identikal info [MODEL] DATA");
  }
  if (options.vehicle) return survey_vehicles(options, model, recordings);
  if (options.json) throw InputError({}, "--json without --vehicle", "info --vehicle DATA --json");
  if (!model && !options.range.empty()) {
    throw InputError({}, "--range does not apply to columns", "a model file, or --vehicle",
                     "identikal info MODEL DATA --range FROM:TO");
  }
  std::string text;
  for (const std::string& argument : recordings) {
    text += columns_text(argument, model, parse_range(options.range));
  }
  print(text);
  return 0;
}

}  // namespace

Verb info_verb(CLI::App& app) {
  const auto options = std::make_shared<InfoOptions>();
  CLI::App& verb = add_verb(app, "info", "Show the columns, units, rates and gaps of a recording.");
  add_arguments(verb, "FILES", options->files,
                "Recordings (CSV), after a model file (YAML) or not.");
  add_range(verb, options->range);
  add_flag(verb, "--vehicle", options->vehicle,
           "Survey a vehicle's recording: signs, units, clocks, what can be identified.");
  add_flag(verb, "--json", options->json, "With --vehicle: Print the survey as JSON.");
  return {"info", [options](const std::string&) { return info(*options); }};
}

}  // namespace identikal
