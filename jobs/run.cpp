#include "jobs/run.h"

#include <algorithm>

#include <fmt/format.h>

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

bool may_go_on(const Call& call) {
  return !(std::chrono::steady_clock::now() > call.deadline) && (!call.goes_on || call.goes_on());
}

bool report_progress(const Call& call, const std::string& what, double share, double value) {
  return may_go_on(call) && (!call.progress || call.progress(what, share, value));
}

void limit_time(Call& call, std::int64_t seconds) {
  if (seconds > 0) call.deadline = std::chrono::steady_clock::now() + std::chrono::seconds(seconds);
}

void notice(const Call& call, const std::string& line) {
  if (call.notice) call.notice(line);
}

double Run::seconds() const {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

bool Run::wants_pictures() const {
  return options.has_page && (!options.page.empty() || !options.folder.empty() || call.wants_page);
}

std::vector<std::string> model_and_included(const std::string& path, Inputs& inputs) {
  std::vector<std::string> out = inputs.included(path);
  out.push_back(path);
  return out;
}

namespace {

ModelSource model_source(const std::string& path, Inputs& inputs) {
  const std::string& text = inputs.model_text(path);
  ModelSource out{path, inputs.sha256(path), text, {}};
  for (const std::string& included : inputs.included(path)) {
    out.included.push_back({included, inputs.sha256(included), inputs.included_text(included)});
  }
  return out;
}

// All that a job has read: nothing is written over it.
std::vector<std::string> files_read(const Run& run, const Recordings& recordings) {
  std::vector<std::string> out = run.read;
  std::vector<std::string> models = run.models;
  if (!run.model.empty()) models.push_back(run.model);
  for (const std::string& model : models) {
    const std::vector<std::string> files = model_and_included(model, run.call.inputs);
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
void add_findings(Estimate& estimate, const Recordings& recordings) {
  const auto add = [&](const Finding& finding) {
    const bool known = std::any_of(estimate.findings.begin(), estimate.findings.end(),
                                   [&](const Finding& f) { return f.text == finding.text; });
    if (!known) estimate.findings.push_back(finding);
  };
  for (const Finding& finding : recordings.findings) add(finding);
  for (const Dataset& data : recordings.data) {
    for (const std::string& note : data.notes)
      add(make_finding(FindingCode::data_treated, {}, note));
    for (const std::string& doubt : data.unknown_units) {
      add(make_finding(FindingCode::unknown_unit, {}, doubt, "correct the header"));
    }
  }
}

// What is wrong with the recordings themselves: whatever was made of them is not to be trusted.
void conclude_from(Estimate& estimate, const Recordings& recordings) {
  const bool serious =
      std::any_of(recordings.findings.begin(), recordings.findings.end(),
                  [](const Finding& f) { return f.severity == Severity::serious; });
  if (serious && estimate.status == Status::ok) conclude(estimate, estimate.message);
}

// Of a job on a result the model is that of the result.
Provenance provenance(const Run& run, const ModelSource* model) {
  if (model == nullptr) return {run.call.command, run.model, ""};
  return {run.call.command, model->path, model->sha256};
}

std::vector<ResultFile> folder_files(const ResultSections& result, const std::string& json,
                                     const std::string& page_data) {
  std::vector<ResultFile> out{{"result.json", json}};
  const bool has_series = result.fit != nullptr && result.fit->series.time.size() > 0;
  if (has_series) out.push_back({"residuals.csv", residuals_csv(result.fit->series)});
  if (result.time_history != nullptr) {
    out.push_back({"course.csv", course_csv(*result.time_history, result.fit->series)});
  }
  if (!page_data.empty()) out.push_back({kReportDataFile, page_data});
  return out;
}

}  // namespace

void add_series(const Series& series, Outcome& out) {
  if (series.time.size() == 0) return;
  out.series.push_back({"time", series.time});
  out.series.push_back({"measured", series.measured.transpose()});
  out.series.push_back({"predicted", series.predicted.transpose()});
  out.series.push_back({"innovations", (series.measured - series.predicted).transpose()});
  if (series.standardised.size() == 0) return;
  out.series.push_back({"standardised", series.standardised.transpose()});
}

void KeptResult::take(ModelSource file) {
  model_file = std::make_shared<const ModelSource>(std::move(file));
  sections.model_file = model_file.get();
}

Outcome outcome_of(const Run& run, KeptResult result) {
  const bool strict = run.options.strict;
  Outcome out;
  out.message = to_string(result.core->status) + ": " + result.core->message;
  out.exit_code = exit_code(*result.core, strict);
  out.estimate = result.core;
  out.fit = std::shared_ptr<const RecordingFit>(result.core, result.sections.fit);
  out.summary = LateText([result] { return console_report(result.sections); });
  if (run.call.wants_text && !run.options.json) out.text = out.summary.text();
  out.json = LateText([result = std::move(result), strict, seconds = run.seconds()] {
    return result_json(result.sections, strict, seconds);
  });
  if (run.call.wants_text && run.options.json) out.text = out.json.text();
  return out;
}

Outcome finish(const Run& run, const Recordings& recordings, KeptResult result,
               const std::vector<ResultFile>& more_files) {
  const ResultOptions& options = run.options;
  const ResultSections& sections = result.sections;
  Inputs& inputs = run.call.inputs;
  result.core->verb = run.verb;
  add_inputs(*result.core, recordings);
  add_findings(*result.core, recordings);
  conclude_from(*result.core, recordings);
  if (sections.model_file == nullptr && !run.model.empty()) {
    result.take(model_source(run.model, inputs));
  }
  Outcome out = outcome_of(run, result);
  if (run.wants_pictures()) {
    out.page_data = report_data_json(report_data(sections, recordings.data, recordings.held_out,
                                                 provenance(run, sections.model_file)),
                                     out.json.text());
  }
  std::vector<OutputFile> written;
  if (!options.page.empty()) {
    const std::string page =
        report_page(out.json.text(), out.page_data, result.sections.model_file);
    written.push_back({options.page, page, "--report"});
  }
  if (!options.folder.empty()) {
    std::vector<ResultFile> files = folder_files(sections, out.json.text(), out.page_data);
    files.insert(files.end(), more_files.begin(), more_files.end());
    const std::vector<OutputFile> of_folder = in_folder(options.folder, files);
    written.insert(written.end(), of_folder.begin(), of_folder.end());
  }
  if (!written.empty()) write_files(written, files_read(run, recordings));
  if (run.call.wants_series && sections.fit != nullptr) add_series(sections.fit->series, out);
  return out;
}

}  // namespace identikal
