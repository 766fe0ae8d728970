#include "jobs/load.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <map>

#include "jobs/quantity.h"
#include <fmt/format.h>

#include "identify/filter/digest_file.h"
#include "identify/filter/model_filter.h"
#include "identify/model/model_file.h"
#include "identify/model/output_conditions.h"
#include "identify/model/own_parameters.h"
#include "identify/model/row_selection.h"
#include "identify/result/file.h"
#include "identify/result/file_digest.h"
#include "identify/result/schema.h"
#include "identify/result/values.h"
#include "lib/base/constants.h"
#include "lib/base/error.h"
#include "lib/base/median.h"
#include "lib/data/join.h"
#include "lib/data/row_time.h"

namespace identikal {

void require_linear(const Model& model, const std::string& job) {
  if (is_linear(model)) return;
  const bool vehicle = is_vehicle(model);
  throw InputError({model.source, 0, 0},
                   fmt::format("'{}' takes a linear model, this {}", job,
                               vehicle ? "is a vehicle" : "one is not linear in its states"),
                   "a model with A, C, Q, R, or formulas that are linear in states and inputs",
                   vehicle ? "use 'fit'" : "");
}

void require_filter(const Model& model, const std::string& job) {
  if (has_filter(model)) return;
  throw InputError({model.source, 0, 0},
                   fmt::format("'{}' takes the model of a filter, this is a {}", job,
                               is_vehicle(model) ? "vehicle" : "regression"),
                   "a model with A, C, Q, R, or formulas",
                   is_vehicle(model) ? "use 'fit'" : "use 'track'");
}

namespace {

Model with_options(Model model, const ModelOptions& options, Inputs& inputs) {
  if (!options.from.empty()) {
    const StoredResult result = inputs.result(options.from);
    if (result.estimate.objective.method == kSimulationMethod) {
      model = simulated_in(result.estimate, inputs.model(options.file, FormulaReading::as_written));
    }
    set_values(model, result.estimate, result.path);
  }
  refuse_twice("--set", options.settings);
  for (const std::string& assignment : options.settings) set_parameter(model, assignment);
  if (!options.filter.empty()) {
    if (!is_formula_model(model) || changes(model)) {
      throw InputError({}, "--filter does not apply to this model", "a nonlinear model",
                       "the Kalman filter of a linear one is exact");
    }
    as_formulas(model).filter = nonlinear_method(options.filter, {});
  }
  return model;
}

}  // namespace

namespace {

void refuse_student(const Model& model, const std::string& verb) {
  static const std::vector<std::string> kTakeIt = {"tune", "fit", "filter", "check", "validate"};
  if (!model.student || std::find(kTakeIt.begin(), kTakeIt.end(), verb) != kTakeIt.end()) return;
  throw InputError(
      {model.source, 0, 0},
      fmt::format("'{}' takes normal measurement noise, this one is Student's t", verb),
      "no kind: student under noise", "tune, fit, filter, check and validate take it");
}

void refuse_own_parameters(const Model& model, const std::string& verb) {
  static const std::vector<std::string> kTakeThem = {"tune",     "fit",   "filter",  "check",
                                                     "simulate", "bound", "forecast"};
  if (model.recordings.empty() ||
      std::find(kTakeThem.begin(), kTakeThem.end(), verb) != kTakeThem.end()) {
    return;
  }
  throw InputError(
      {model.source, 0, 0},
      fmt::format("'{}' takes no parameters with values of their own in each recording", verb),
      "a model without 'per' and 'recordings'",
      "tune, fit, filter, check, forecast, bound and validate take them");
}

}  // namespace

Model load_any_model(const ModelOptions& options, Inputs& inputs) {
  const Model model = inputs.model(options.file);
  refuse_own_parameters(model, "track");
  return with_options(model, options, inputs);
}

Model load_model(const ModelOptions& options, const std::string& verb, Inputs& inputs,
                 FormulaReading reading) {
  Model model = inputs.model(options.file, reading);
  if (is_regression(model)) {
    throw InputError({model.source, 0, 0}, fmt::format("'{}' takes no regression", verb),
                     "identikal track MODEL DATA");
  }
  refuse_student(model, verb);
  refuse_own_parameters(model, verb);
  return with_options(std::move(model), options, inputs);
}

std::vector<Table> read_files(const std::string& argument, Inputs& inputs) {
  if (inputs.is_in_memory(argument)) return {inputs.table(argument)};
  std::vector<Table> out;
  for (const std::string& path : joined_files(argument)) out.push_back(inputs.table(path));
  return out;
}

namespace {

// Outputs are missing where their condition does not hold; columns that it asks are read for that.
void ask_conditions(const Table& run, const TimeSource& time, const Model& model,
                    const TimeRange& range, Dataset& data) {
  Eigen::MatrixXd flags(0, data.size());
  if (!model.flags.empty()) {
    Dataset asked = make_dataset(run, time, model.flags, {}, range);
    flags = std::move(asked.u);
    data.notes.insert(data.notes.end(), asked.notes.begin(), asked.notes.end());
  }
  apply_conditions(model, flags, data);
}

// Is every row one step behind the one before?
bool is_even(const Dataset& data, double step) {
  constexpr double kTolerance = 1e-2;
  const Eigen::Index N = data.size();
  const Eigen::ArrayXd between = data.time.tail(N - 1) - data.time.head(N - 1);
  return ((between - step).abs() <= kTolerance * step).all();
}

// Of a recording that has less than two thirds of its grid's rows, which no reader would expect.
void note_absent_rows(Dataset& data) {
  const auto absent = static_cast<Eigen::Index>(data.absent.size());
  if (3 * absent < data.size()) return;
  data.notes.push_back(
      fmt::format("{} of the {} rows of {} on its grid of {:.6g} s are recorded; "
                  "the others are taken as missing samples",
                  data.size() - absent, data.size(), data.name, data.dt));
}

}  // namespace

std::vector<Dataset> load_runs(const std::vector<Table>& files, const Model& model,
                               const TimeRange& range, bool with_outputs) {
  if (model.time.restarts && files.size() > 1) {
    throw InputError(model.time.at, "runs: restart with files that are joined",
                     "one file, or one run");
  }
  const Joined joined = join_tables(files, model.time);
  const std::vector<ChannelSource> no_outputs;
  const bool continuous = is_formula_model(model) && as_formulas(model).equations.continuous;
  const bool irregular = is_formula_model(model) && as_formulas(model).irregular;
  TimeSource time = model.time;
  time.rows_absent = has_filter(model) && !irregular;
  time.replicates = continuous && irregular;
  std::vector<Dataset> out;
  for (const Table& run : split_runs(joined.table, time)) {
    Dataset data = make_dataset(run, time, model.inputs, with_outputs ? model.outputs : no_outputs,
                                range, model.references.channels);
    if (with_outputs) ask_conditions(run, time, model, range, data);
    data.notes.insert(data.notes.begin(), joined.notes.begin(), joined.notes.end());
    // Equations of motion keep stamps that are even as they are, to the clock's last digit.
    const double step = model.time.step > 0.0 ? model.time.step : data.dt;
    const bool as_recorded = is_vehicle(model) || irregular || (continuous && is_even(data, step));
    if (!as_recorded) {
      data = on_uniform_grid(data, step);
      note_absent_rows(data);
    }
    if (range.from > 0.0) {
      data.begins = "where --range begins";
    } else if (!out.empty()) {
      data.begins = "where the time stamps start again";
    }
    for (Dataset& segment : usable_segments(model, std::move(data))) {
      out.push_back(std::move(segment));
    }
  }
  return out;
}

Dataset load_data(const std::vector<Table>& files, const Model& model, const TimeRange& range,
                  bool with_outputs) {
  std::vector<Dataset> runs = load_runs(files, model, range, with_outputs);
  if (runs.size() > 1) {
    throw InputError({files.front().path, 0, 0}, fmt::format("{} runs", runs.size()),
                     "one run here", "'fit', 'tune' and 'check' take several");
  }
  return std::move(runs.front());
}

namespace {

// A start that is given, or one at rest, belongs to a recording's begin; a filter that begins
// elsewhere takes it too.
Findings check_starts(const Model& model, const std::vector<Dataset>& runs) {
  if (!has_filter(model)) return {};
  const InitialState initial = noise_model(model).initial;
  const bool driven = !model.inputs.empty();
  const bool of_the_begin =
      initial == InitialState::given || (initial == InitialState::stationary && driven);
  if (!of_the_begin) return {};
  struct Starts {
    std::size_t count = 0;
    std::string text;
    void add(const Dataset& run) {
      if (++count > 5) return;
      text += fmt::format("{}at t = {}, {}", count > 1 ? "; " : "", row_time(run, 0), run.begins);
    }
    std::string in_short() const {
      return count > 5 ? fmt::format("{}; and {} times more", text, count - 5) : text;
    }
  };
  Starts at_gaps, wanted;
  for (const Dataset& run : runs) {
    if (run.begins.empty()) continue;
    (run.begins.starts_with("after") ? at_gaps : wanted).add(run);
  }
  const std::string& name = runs.front().name;
  Findings findings;
  if (at_gaps.count > 0) {
    findings.push_back(make_finding(
        FindingCode::starts_anew, {},
        fmt::format("{}: the filter restarts from 'initial' {}", name, at_gaps.in_short()),
        "fill the gaps, or give 'initial' variances that hold for the state there too"));
  }
  if (wanted.count > 0) {
    findings.push_back(make_finding(
        FindingCode::starts_within, {},
        fmt::format("{}: the filter starts from 'initial' {}", name, wanted.in_short()),
        "'initial' is to hold there too"));
  }
  return findings;
}

// Without a column of time stamps rows are a step apart: does the file have another one?
Findings check_step(const Model& model, const Table& table) {
  if (!model.time.column.empty() || !(model.time.step > 0.0) || table.rows < 2) return {};
  const auto read = [&](const Column& column) {
    const auto is_it = [&](const ChannelSource& c) { return c.column == column.name; };
    return std::any_of(model.inputs.begin(), model.inputs.end(), is_it) ||
           std::any_of(model.outputs.begin(), model.outputs.end(), is_it);
  };
  for (const Column& column : table.columns) {
    if (!looks_like_time(column) || read(column)) continue;
    TimeSource source;
    source.column = column.name;
    source.unit = time_unit(column);
    Eigen::VectorXd t;
    try {
      t = time_stamps(table, source);
    } catch (const InputError&) {
      continue;  // not time stamps
    }
    const Eigen::VectorXd steps = t.tail(t.size() - 1) - t.head(t.size() - 1);
    const double usual = median({steps.begin(), steps.end()});
    if (std::abs(usual - model.time.step) <= 0.01 * model.time.step) continue;
    constexpr double kDay = 86400.0;
    if (column.dates != Dates::none && usual >= kDay) continue;  // days and months may count as 1
    return {make_finding(
        FindingCode::step_differs, {},
        fmt::format(
            "the model file gives {:.6g} s from row to row, column '{}' of {} {:.6g} s (median)",
            model.time.step, column.name, std::filesystem::path(table.path).filename().string(),
            usual),
        fmt::format("correct 'step', or write time: {{column: {}}}", column.name))};
  }
  return {};
}

// Data that are given twice weigh twice, and their errors look too small.
Findings check_repeated(const std::vector<InputRecord>& records) {
  Findings findings;
  for (auto record = records.begin(); record != records.end(); ++record) {
    const auto same = [&](const InputRecord& r) { return r.sha256 == record->sha256; };
    const auto first = std::find_if(records.begin(), record, same);
    if (first == record) continue;
    const std::string what =
        first->path == record->path
            ? fmt::format("{} is given twice", record->path)
            : fmt::format("{} is the same data as {}", record->path, first->path);
    findings.push_back(make_finding(FindingCode::repeated_data, {record->path},
                                    what + ": it counts twice, and standard errors are too small",
                                    "give each recording once"));
  }
  return findings;
}

// Is what is held out among what is fitted?
Findings check_own(const std::string& held_out, Inputs& inputs,
                   const std::vector<InputRecord>& records) {
  const std::string sha256 = inputs.sha256(held_out);
  const bool fitted = std::any_of(records.begin(), records.end(), [&](const InputRecord& record) {
    return record.sha256 == sha256;
  });
  if (!fitted) return {};
  return {make_finding(FindingCode::own_data, {held_out},
                       held_out + " is held out and fitted: this proves nothing",
                       "hold out another recording, or a share such as 30%")};
}

}  // namespace

std::vector<std::string> files_of(const StoredResult& result, const std::string& named) {
  const std::filesystem::path beside =
      std::filesystem::path(result.path).parent_path() / kReportDataFile;
  std::vector<std::string> out{named, result.path, beside.string()};
  for (const InputRecord& input : result.estimate.inputs) out.push_back(input.path);
  if (result.estimate.model_file) {
    out.push_back(result.estimate.model_file->path);
    for (const auto& included : result.estimate.model_file->included) out.push_back(included.path);
  }
  return out;
}

std::vector<std::string> files_of_origin(const ModelOptions& options, Inputs& inputs) {
  if (options.from.empty()) return {};
  return files_of(inputs.result(options.from), options.from);
}

Findings findings_of_origin(const ModelOptions& options, Inputs& inputs) {
  Findings findings;
  if (options.from.empty()) return findings;
  const StoredResult result = inputs.result(options.from);
  const StoredEstimate& e = result.estimate;
  if (e.status != Status::ok) {
    findings.push_back(make_finding(
        FindingCode::doubtful_result, {},
        fmt::format("{} is itself {}: {}", options.from, to_string(e.status), e.message), ""));
  }
  if (e.model_file && e.model_file->sha256 != inputs.sha256(options.file)) {
    findings.push_back(
        make_finding(FindingCode::model_changed, {options.file},
                     fmt::format("the values of {} are those of another model file ({}), or it "
                                 "has changed since",
                                 options.from, e.model_file->path),
                     fmt::format("'identikal export {} --to yaml' prints the model that it is of",
                                 options.from)));
  }
  return findings;
}

void Recordings::add(std::vector<Dataset> runs, const std::vector<Table>& files,
                     const TimeRange& range, Inputs& inputs) {
  long rows = 0;
  for (const Dataset& run : runs) {
    rows += static_cast<long>(run.size()) - static_cast<long>(run.absent.size());
  }
  for (const Table& file : files) {
    records.push_back({file.path,
                       inputs.sha256(file.path),
                       static_cast<long>(file.rows),
                       rows,
                       {range.from, range.to}});
    of_records.emplace_back(data.size(), data.size() + runs.size());
  }
  for (Dataset& run : runs) data.push_back(std::move(run));
}

void take_period(Model& model, const Dataset& data) {
  if (has_filter(model) && model.time.step == 0.0) noise_model(model).dt = data.dt;
}

void check_period(const Model& model, const Dataset& first, const Dataset& other) {
  const bool one_period = is_linear(model) || (changes(model) && !as_formulas(model).irregular);
  const bool any = !one_period || model.time.step > 0.0;
  if (any || std::abs(other.dt - first.dt) <= 1e-6 * first.dt) return;
  throw InputError(
      {other.name, 0, 0},
      fmt::format("sampled every {:.6g} s, {} every {:.6g} s", other.dt, first.name, first.dt),
      "recordings with the same sampling period",
      "a discrete-time model belongs to one sampling period");
}

Recordings load_recordings(const RecordingOptions& options, const Model& model,
                           const std::string& verb, Inputs& inputs) {
  const TimeRange range = parse_range(options.range);
  Recordings out;
  for (const std::string& path : options.files) {
    if (is_digest_name(path)) {
      throw InputError({path, 0, 0}, fmt::format("a digest for '{}'", verb), "a recording",
                       "'tune', 'check' and 'bound' take digests");
    }
    if (inputs.is_model(path)) {
      throw InputError(
          {path, 0, 0}, "a model file where recordings are expected",
          fmt::format("'identikal {} {} DATA...'", verb, verb == "validate" ? "RESULT" : "MODEL"),
          "'identikal compare A.yaml B.yaml DATA' ranks several models");
    }
    const std::vector<Table> files = read_files(path, inputs);
    std::vector<Dataset> runs = load_runs(files, model, range);
    append(out.findings, check_starts(model, runs));
    append(out.findings, check_step(model, files.front()));
    if (!inputs.labels(path).empty()) out.labels[runs.front().name] = inputs.labels(path);
    out.add(std::move(runs), files, range, inputs);
    check_period(model, out.data.front(), out.data.back());
  }
  append(out.findings, check_repeated(out.records));
  return out;
}

namespace {

// What the caller knows of a recording goes without saying in the model file.
void take_labels(const Recordings& recordings, RecordingTable& table) {
  for (const auto& each : recordings.labels) {
    const std::string& recording = each.first;
    const std::string stem = std::filesystem::path(recording).stem().string();
    auto row = std::find_if(table.rows.begin(), table.rows.end(), [&](const auto& known) {
      return known.recording == recording || known.recording == stem;
    });
    if (row == table.rows.end()) {
      table.rows.push_back({recording, {}, {}, {}, {}});
      row = std::prev(table.rows.end());
    }
    row->labels.insert(each.second.begin(), each.second.end());
  }
}

}  // namespace

Model joint_model(Model model, Recordings& recordings) {
  if (model.recordings.empty()) return model;
  take_labels(recordings, model.recordings);
  std::map<std::string, std::string> paths;
  for (const InputRecord& record : recordings.records) {
    const std::string name = std::filesystem::path(record.path).filename().string();
    const auto [first, is_new] = paths.try_emplace(name, record.path);
    if (is_new) continue;
    throw InputError({record.path, 0, 0},
                     fmt::format("is called as {}, and parameters have values of their own in each "
                                 "recording, by its file's name",
                                 first->second),
                     "files of different names, each once");
  }
  return for_recordings(std::move(model), recordings.data);
}

Model model_of_recording(Model model, Dataset& recording) {
  if (model.recordings.empty()) return model;
  std::vector<Dataset> alone = {recording};
  const Model joint = for_recordings(std::move(model), alone);
  Model out = model_in(joint, alone.front());
  recording.own.clear();
  return out;
}

namespace {

// The rows before a recording that a range has cut, and how many they are; none: nothing to go on
// from.
std::pair<Dataset, Eigen::Index> with_rows_before(const std::string& file, const Model& model,
                                                  const TimeRange& range, const Dataset& recording,
                                                  Inputs& inputs) {
  std::vector<Dataset> all;
  try {
    all = load_runs(read_files(file, inputs), model, range);
  } catch (const InputError&) {
    return {{}, 0};  // they are none that a filter could run through
  }
  // Of rows that use_when or a missing input cuts, those from the last cut on.
  Dataset& whole = all.back();
  whole.own = recording.own;
  Eigen::Index from = 0;
  while (from < whole.size() && whole.time[from] < recording.time[0]) ++from;
  if (whole.size() - from != recording.size()) from = 0;
  return {std::move(whole), from};
}

void say_going_on(Recordings& recordings, Dataset& recording, const std::string& how) {
  recording.begins.clear();
  recordings.findings.push_back(make_finding(
      FindingCode::goes_on, {}, fmt::format("{}: the filter {}", recording.name, how), ""));
}

// A start that the file gives holds where a recording begins, and not where a range does.
Model starting_diffuse(Model model, Recordings& recordings) {
  LinearModel& noise = noise_model(model);
  if (noise.initial != InitialState::given) return model;
  noise.initial = InitialState::diffuse;
  noise.stationary.clear();
  noise.known.clear();
  for (Dataset& recording : recordings.data) {
    say_going_on(recordings, recording, "starts diffuse, where --range begins");
  }
  return model;
}

// Every recording from its own state. False where one has no rows before to come from.
bool start_from_rows_before(const Model& model, const RecordingOptions& options,
                            const TimeRange& range, Recordings& recordings, Inputs& inputs) {
  std::vector<std::pair<Model, Eigen::Index>> starts;
  for (std::size_t i = 0; i < options.files.size(); ++i) {
    const auto [whole, from] =
        with_rows_before(options.files[i], model, range, recordings.data[i], inputs);
    std::optional<Model> start =
        from > 0 ? going_on(model, model.parameters, whole, from) : std::nullopt;
    if (!start) return false;
    starts.emplace_back(*std::move(start), from);
  }
  for (std::size_t i = 0; i < starts.size(); ++i) {
    const LinearModel& start = noise_model(starts[i].first);
    recordings.data[i].start_mean = start.x0.constant;
    recordings.data[i].start_covariance = start.P0.constant;
    say_going_on(recordings, recordings.data[i],
                 fmt::format("goes on from the {} rows before", starts[i].second));
  }
  return true;
}

}  // namespace

Model going_on_from_rows_before(Model model, const RecordingOptions& options,
                                Recordings& recordings, Inputs& inputs) {
  TimeRange range = parse_range(options.range);
  if (!(range.from > 0.0) || recordings.data.size() != options.files.size()) return model;
  range.from = -kInfinity;
  const auto forget_starts = [&] {
    std::erase_if(recordings.findings, [](const Finding& finding) {
      return finding.code == FindingCode::starts_within;
    });
  };
  const bool several = recordings.data.size() > 1;
  if (several && (is_linear(model) || changes(model))) {
    if (noise_model(model).initial == InitialState::given) forget_starts();
    return starting_diffuse(std::move(model), recordings);
  }
  if (several) {
    if (start_from_rows_before(model, options, range, recordings, inputs)) forget_starts();
    return model;
  }
  Dataset& recording = recordings.data.front();
  const auto [whole, from] =
      with_rows_before(options.files.front(), model, range, recording, inputs);
  std::optional<Model> out = going_on(model, model.parameters, whole, from);
  if (!out) return model;
  forget_starts();
  say_going_on(recordings, recording, fmt::format("goes on from the {} rows before", from));
  return *std::move(out);
}

std::vector<HeldOut> hold_out(const std::string& hold_out, const Model& model,
                              const TimeRange& range, Recordings& recordings, Inputs& inputs) {
  std::vector<HeldOut> out;
  if (hold_out.empty()) return out;
  if (!hold_out.ends_with('%')) {
    const std::vector<Table> files = read_files(hold_out, inputs);
    for (const Table& file : files) {
      recordings.held_out_files.push_back(file.path);
      append(recordings.findings, check_own(file.path, inputs, recordings.records));
    }
    for (Dataset& run : load_runs(files, model, range)) out.push_back({std::move(run), 0});
    return out;
  }
  const double share = hold_out_share(hold_out);
  for (std::size_t i = 0; i < recordings.data.size(); ++i) {
    Dataset& data = recordings.data[i];
    const auto kept =
        static_cast<Eigen::Index>(std::llround((1.0 - share) * static_cast<double>(data.size())));
    // A segment of a few rows is fitted whole.
    if (kept < 1 || kept >= data.size()) continue;
    out.push_back({data, kept});
    data = first_samples(data, kept);
    for (std::size_t file = 0; file < recordings.records.size(); ++file) {
      if (recordings.of_records[file] != std::pair(i, i + 1)) continue;
      std::array<double, 2>& used = recordings.records[file].range;
      const double begin = std::isfinite(used[0]) ? used[0] : 0.0;
      used[1] = begin + data.time[kept - 1] - data.time[0];
    }
  }
  if (out.empty()) {
    throw InputError({}, fmt::format("--hold-out '{}' of too few rows", hold_out),
                     "a longer recording");
  }
  return out;
}

}  // namespace identikal
