#include "command/run.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <iostream>

#include <fmt/format.h>
#include <unistd.h>

#include "identify/model/included_files.h"
#include "identify/model/yaml_reader.h"
#include "identify/report/console.h"
#include "identify/report/page.h"
#include "identify/report/page_data.h"
#include "identify/result/csv.h"
#include "identify/result/file.h"
#include "identify/result/file_digest.h"
#include "identify/result/json.h"
#include "identify/result/schema.h"
#include "lib/base/error.h"

namespace identikal {

void print(const std::string& text) {
  std::cout << text << std::flush;
  if (!std::cout) throw OutputError("standard output: cannot write");
}

Progress::Progress(bool quiet) : shown_(!quiet && isatty(STDERR_FILENO) != 0) {}

void Progress::show(const std::string& text) {
  if (!shown_) return;
  fmt::print(stderr, "\r\033[K{}", text);
  std::fflush(stderr);
  dirty_ = true;
}

void Progress::clear() {
  if (dirty_) fmt::print(stderr, "\r\033[K");
  dirty_ = false;
}

double Run::seconds() const {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

bool wants_pictures(const ResultOptions& options) {
  return options.has_page && (!options.page.empty() || !options.folder.empty());
}

std::vector<std::string> model_and_included(const std::string& path) {
  std::error_code unknown;
  if (!std::filesystem::is_regular_file(path, unknown)) return {path};  // a pipe is read once
  std::vector<std::string> out = included_files(read_yaml_text(path), path);
  out.push_back(path);
  return out;
}

namespace {

ModelSource model_source(const std::string& path) {
  const std::string text = text_of_file(path);
  ModelSource out{path, sha256_of_text(text), text, {}};
  for (const std::string& included : included_files(read_yaml_text(path), path)) {
    out.included.push_back({included, sha256_of_file(included)});
  }
  return out;
}

// All that a job has read: nothing is written over it.
std::vector<std::string> files_read(const Run& run, const Recordings& recordings) {
  std::vector<std::string> out = run.read;
  std::vector<std::string> models = run.models;
  if (!run.model.empty()) models.push_back(run.model);
  for (const std::string& model : models) {
    const std::vector<std::string> files = model_and_included(model);
    out.insert(out.end(), files.begin(), files.end());
  }
  for (const InputRecord& record : recordings.records) out.push_back(record.path);
  out.insert(out.end(), recordings.held_out_files.begin(), recordings.held_out_files.end());
  return out;
}

// Those of the recordings; how many rows were used may be the estimate's own count.
void add_inputs(Estimate& estimate, const Recordings& recordings) {
  const std::vector<InputRecord> used = estimate.inputs;
  estimate.inputs = recordings.records;
  for (std::size_t i = 0; i < estimate.inputs.size(); ++i) {
    const auto [from, to] = recordings.of_records[i];
    if (to > used.size()) continue;
    estimate.inputs[i].used = 0;
    for (std::size_t run = from; run < to; ++run) estimate.inputs[i].used += used[run].used;
  }
}

// Notes and doubts of the recordings, each text once.
void add_warnings(Estimate& estimate, const Recordings& recordings) {
  const auto add = [&](const Warning& warning) {
    const bool known = std::any_of(estimate.warnings.begin(), estimate.warnings.end(),
                                   [&](const Warning& w) { return w.text == warning.text; });
    if (!known) estimate.warnings.push_back(warning);
  };
  for (const Warning& warning : recordings.warnings) add(warning);
  for (const Dataset& data : recordings.data) {
    for (const std::string& note : data.notes) add({"data_treated", Severity::note, {}, note, ""});
    for (const std::string& doubt : data.unknown_units) {
      add({"unknown_unit", Severity::warning, {}, doubt, "correct the header"});
    }
  }
}

std::vector<ResultFile> folder_files(const Estimate& estimate, const std::string& json,
                                     const std::string& page_data) {
  std::vector<ResultFile> out{{"result.json", json}};
  if (estimate.series.time.size() > 0) out.push_back({"residuals.csv", residuals_csv(estimate)});
  if (estimate.time_history) out.push_back({"course.csv", course_csv(estimate)});
  if (!page_data.empty()) out.push_back({kReportDataFile, page_data});
  return out;
}

}  // namespace

int finish(const Run& run, const Recordings& recordings, Estimate& estimate,
           const std::vector<ResultFile>& more_files) {
  const ResultOptions& options = run.options;
  estimate.verb = run.verb;
  if (!estimate.model_file && !run.model.empty()) estimate.model_file = model_source(run.model);
  add_inputs(estimate, recordings);
  add_warnings(estimate, recordings);
  const std::string json = result_json(estimate, options.strict, run.seconds());
  std::string page_data;
  if (wants_pictures(options)) {
    page_data = report_data_json(report_data(estimate, recordings.data, recordings.held_out,
                                             {run.command, run.model, sha256_of_file(run.model)}),
                                 json);
  }
  std::vector<OutputFile> written;
  if (!options.page.empty()) {
    written.push_back({options.page, report_page(json, page_data), "--report"});
  }
  if (!options.folder.empty()) {
    std::vector<ResultFile> files = folder_files(estimate, json, page_data);
    files.insert(files.end(), more_files.begin(), more_files.end());
    const std::vector<OutputFile> of_folder = in_folder(options.folder, files);
    written.insert(written.end(), of_folder.begin(), of_folder.end());
  }
  if (!written.empty()) write_files(written, files_read(run, recordings));
  print(options.json ? json : console_report(estimate));
  return exit_code(estimate, options.strict);
}

}  // namespace identikal
