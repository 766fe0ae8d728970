// The command line. Every exception ends here.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <iostream>
#include <limits>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sys/stat.h>
#include <unistd.h>

#include "identify/bound.h"
#include "identify/check.h"
#include "identify/command_reference.h"
#include "identify/compare.h"
#include "identify/compare_results.h"
#include "identify/estimated_model.h"
#include "identify/export_result.h"
#include "identify/figure.h"
#include "identify/filter_pictures.h"
#include "identify/filter_run.h"
#include "identify/free_run.h"
#include "identify/included_files.h"
#include "identify/info.h"
#include "identify/manoeuvres.h"
#include "identify/model_file.h"
#include "identify/noise_als.h"
#include "identify/noise_auto.h"
#include "identify/noise_bayes.h"
#include "identify/noise_estimate.h"
#include "identify/noise_ml.h"
#include "identify/noise_track.h"
#include "identify/regression_track.h"
#include "identify/report.h"
#include "identify/report_page.h"
#include "identify/result_file.h"
#include "identify/result_values.h"
#include "identify/row_selection.h"
#include "identify/shape.h"
#include "identify/simulate.h"
#include "identify/study.h"
#include "identify/survey_report.h"
#include "identify/suspect_data.h"
#include "identify/templates.h"
#include "identify/validate.h"
#include "identify/vehicle_columns.h"
#include "identify/vehicle_fit.h"
#include "identify/vehicle_survey.h"
#include "identify/vehicle_track.h"
#include "identify/yaml_reader.h"
#include "lib/csv.h"
#include "lib/dataset.h"
#include "lib/error.h"
#include "lib/join.h"
#include "lib/nearest_name.h"
#include "lib/units.h"
#include "lib/version.h"

namespace identikal {
namespace {

struct Arguments {
  std::string verb, model;
  std::vector<std::string> data;
  std::string output, report;
  std::string command;  // as typed, for the report
  bool json = false, strict = false, quiet = false;
  std::int64_t seed = 1;
  int starts = 5, runs = 0, threads = 0, bootstrap = 0;
  std::vector<std::string> settings;
  std::string path = "automatic";
  std::string method = "ml", accuracy, place = "both", hold_out;
  std::string language, least_fit;
  int order = 4;
  bool regain = false, robust = false, adaptive = false;
  bool vehicle = false;
  bool compare = false, full_matrix = false, sources = false;
  long lags = 0, draws = 0;
  std::string range, manoeuvre, speed, rate = "100 Hz", duration, snr;
  std::vector<std::string> manoeuvre_settings, signals;
  std::string filter;
  long rows = 0;
  bool smooth = false;
  long lag = -1;  // fixed-lag smoother; -1: not asked for
  std::string from;
};

// On standard output; one that takes no more, as on a full disk, is said.
void print(const std::string& text) {
  std::cout << text << std::flush;
  if (!std::cout) throw OutputError("standard output: cannot write");
}

// "12", "12s", "60 km/h" in SI; `kind` is a unit of the quantity expected.
double quantity(const std::string& option, const std::string& text, const std::string& kind) {
  std::size_t used = 0;
  double value = 0.0;
  try {
    value = std::stod(text, &used);
  } catch (const std::exception&) {
    throw InputError({}, fmt::format("{} '{}' is not a quantity", option, text),
                     "a number, with a unit or in " + kind);
  }
  const std::string rest = text.substr(used);
  const auto unit = parse_unit(rest.find_first_not_of(' ') == std::string::npos ? kind : rest);
  if (!unit || !same_dimension(*unit, *parse_unit(kind)) || !std::isfinite(value)) {
    throw InputError({}, fmt::format("{} '{}' is not a quantity", option, text),
                     "a number, with a unit or in " + kind);
  }
  return unit->to_si(value);
}

TimeRange parse_range(const std::string& text) {
  TimeRange range;
  if (text.empty()) return range;
  const std::size_t colon = text.find(':');
  if (colon == std::string::npos) {
    throw InputError({}, fmt::format("--range '{}' is not a range", text), "FROM:TO, e.g. 10s:95s");
  }
  const std::string from = text.substr(0, colon), to = text.substr(colon + 1);
  if (!from.empty()) range.from = quantity("--range", from, "s");
  if (!to.empty()) range.to = quantity("--range", to, "s");
  return range;
}

void require_linear(const Arguments& args, const ModelFile& model) {
  if (model.form == ModelFile::Form::linear) return;
  const bool vehicle = model.form == ModelFile::Form::single_track;
  const std::string method = args.method == "ml" ? "" : " --method " + args.method;
  throw InputError({model.path, 0, 0},
                   fmt::format("'{}{}' takes a linear model, this {}", args.verb, method,
                               vehicle ? "is a vehicle" : "one is not linear in its states"),
                   "a model with A, C, Q, R, or formulas that are linear in states and inputs");
}

// A model whose filter is to run: matrices or formulas.
void require_filter(const Arguments& args, const ModelFile& model) {
  if (model.form != ModelFile::Form::nonlinear) require_linear(args, model);
}

ModelFile load_model(const Arguments& args) {
  ModelFile model = read_model_file(args.model);
  if (model.form == ModelFile::Form::regression && args.verb != "track") {
    throw InputError({model.path, 0, 0}, fmt::format("'{}' takes no regression", args.verb),
                     "identikal track MODEL DATA");
  }
  if (!args.from.empty()) {
    const StoredResult result = read_stored_result(args.from);
    set_values(model, result.estimate, result.path);
  }
  for (const std::string& assignment : args.settings) set_parameter(model, assignment);
  if (!args.filter.empty()) {
    if (model.form != ModelFile::Form::nonlinear) {
      throw InputError({}, "--filter has no meaning here", "a nonlinear model",
                       "the Kalman filter of a linear one is exact");
    }
    model.formulas.filter = nonlinear_method(args.filter, {});
  }
  return model;
}

// The files that one DATA argument names, read.
std::vector<Table> read_files(const std::string& argument) {
  std::vector<Table> out;
  for (const std::string& path : joined_files(argument)) out.push_back(read_csv(path));
  return out;
}

// One recording, or several where the model file says that time restarts.
std::vector<Dataset> load_runs(const Arguments& args, const std::vector<Table>& files,
                               const ModelFile& model, bool with_outputs = true) {
  if (model.time.restarts && files.size() > 1) {
    throw InputError(model.time.at, "runs: restart with files that are joined",
                     "one file, or one run");
  }
  const Joined joined = join_tables(files, model.time);
  const std::vector<ChannelSource> no_outputs;
  std::vector<Dataset> out;
  for (const Table& run : split_runs(joined.table, model.time)) {
    Dataset data = make_dataset(run, model.time, model.inputs,
                                with_outputs ? model.outputs : no_outputs, parse_range(args.range));
    data.notes.insert(data.notes.begin(), joined.notes.begin(), joined.notes.end());
    const bool as_recorded =
        model.form == ModelFile::Form::single_track ||
        (model.form == ModelFile::Form::nonlinear && model.formulas.model.continuous);
    if (!as_recorded) {
      const double step = model.time.step > 0.0 ? model.time.step : data.dt;
      data = on_uniform_raster(data, step);
    }
    for (Dataset& stretch : usable_stretches(model, std::move(data))) {
      out.push_back(std::move(stretch));
    }
  }
  return out;
}

Dataset load_data(const Arguments& args, const std::vector<Table>& files, const ModelFile& model,
                  bool with_outputs = true) {
  std::vector<Dataset> runs = load_runs(args, files, model, with_outputs);
  if (runs.size() > 1) {
    throw InputError({files.front().path, 0, 0}, fmt::format("{} runs", runs.size()),
                     "one run here", "'fit', 'tune' and 'check' take several");
  }
  return std::move(runs.front());
}

struct Recordings {
  std::vector<Dataset> data;
  std::vector<InputRecord> records;                             // one per file
  std::vector<std::pair<std::size_t, std::size_t>> of_records;  // recordings [from, to) of a file

  void add(std::vector<Dataset> runs, const std::vector<Table>& files, const TimeRange& range) {
    long rows = 0;
    for (const Dataset& run : runs) rows += static_cast<long>(run.size());
    for (const Table& file : files) {
      records.push_back({file.path,
                         sha256_of_file(file.path),
                         static_cast<long>(file.rows),
                         rows,
                         {range.from, range.to}});
      of_records.emplace_back(data.size(), data.size() + runs.size());
    }
    for (Dataset& run : runs) data.push_back(std::move(run));
  }
};

// A linear model has one sampling period.
void check_period(const Arguments& args, const ModelFile& model, const Dataset& first,
                  const Dataset& other) {
  const bool any = model.form != ModelFile::Form::linear || model.time.step > 0.0;
  if (any || std::abs(other.dt - first.dt) <= 1e-6 * first.dt) return;
  throw InputError({other.name, 0, 0},
                   fmt::format("sampled every {:.6g} s, {} every {:.6g} s", other.dt,
                               args.data.front(), first.dt),
                   "recordings with the same sampling period",
                   "a discrete-time model belongs to one sampling period");
}

bool is_model(const std::string& path) {
  const std::string ending = std::filesystem::path(path).extension().string();
  return ending == ".yaml" || ending == ".yml";
}

Recordings load_recordings(const Arguments& args, const ModelFile& model) {
  Recordings out;
  for (const std::string& path : args.data) {
    if (is_model(path)) {
      throw InputError({path, 0, 0}, "a model file where recordings are expected",
                       fmt::format("'identikal {} MODEL DATA...'", args.verb),
                       "'identikal check --compare A.yaml B.yaml DATA' ranks several models");
    }
    const std::vector<Table> files = read_files(path);
    out.add(load_runs(args, files, model), files, parse_range(args.range));
    check_period(args, model, out.data.front(), out.data.back());
  }
  return out;
}

bool is_als(const Arguments& args) { return args.method == "als" || args.method == "als-weighted"; }

// One line that rewrites itself, on a terminal only.
class Progress {
 public:
  explicit Progress(const Arguments& args) : shown_(!args.quiet && isatty(STDERR_FILENO) != 0) {}
  ~Progress() { clear(); }
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;
  void show(const std::string& text) {
    if (!shown_) return;
    fmt::print(stderr, "\r\033[K{}", text);
    std::fflush(stderr);
    dirty_ = true;
  }
  void clear() {
    if (dirty_) fmt::print(stderr, "\r\033[K");
    dirty_ = false;
  }

 private:
  bool shown_;
  bool dirty_ = false;
};

// Whether pictures are worth making: they go into the report, which -o makes possible later.
bool wants_pictures(const Arguments& args) {
  const bool pictured =
      args.verb != "bound" && args.verb != "filter" && args.verb != "validate" && !args.compare;
  return pictured && (!args.report.empty() || !args.output.empty());
}

std::string report_data_text(const Arguments& args, const Recordings& recordings,
                             const Estimate& estimate, const std::string& json) {
  return report_data_json(report_data(estimate, recordings.data,
                                      {args.command, args.model, sha256_of_file(args.model)}),
                          json);
}

void write_page(const std::string& path, const std::string& page,
                const std::string& option = "--report") {
  const std::filesystem::path file(path);
  const std::string folder = file.parent_path().string();
  write_files(folder.empty() ? "." : folder, {{file.filename().string(), page}}, option);
}

// UTC day on which a file was written, "2026-03-01".
std::string day_of_file(const std::string& path) {
  struct stat status {};
  std::tm utc{};
  if (stat(path.c_str(), &status) != 0 || gmtime_r(&status.st_mtime, &utc) == nullptr) return "";
  return fmt::format("{:04}-{:02}-{:02}", utc.tm_year + 1900, utc.tm_mon + 1, utc.tm_mday);
}

int finish(const Arguments& args, const Recordings& recordings, Estimate& estimate,
           std::chrono::steady_clock::time_point begin,
           const std::vector<ResultFile>& more_files = {}) {
  estimate.verb = args.verb;
  if (!estimate.model_file && !args.compare) {
    const std::string text = text_of_file(args.model);
    estimate.model_file = {args.model, sha256_of_text(text), text, {}};
    for (const std::string& path : included_files(read_yaml_text(args.model), args.model)) {
      estimate.model_file->included.push_back({path, sha256_of_file(path)});
    }
  }
  // The vehicle fit says itself how many rows it used.
  const std::vector<InputRecord> used = estimate.inputs;
  estimate.inputs = recordings.records;
  for (std::size_t i = 0; i < estimate.inputs.size(); ++i) {
    const auto [from, to] = recordings.of_records[i];
    if (to > used.size()) continue;
    estimate.inputs[i].used = 0;
    for (std::size_t run = from; run < to; ++run) estimate.inputs[i].used += used[run].used;
  }
  const auto say_once = [&](const Warning& warning) {
    const bool said = std::any_of(estimate.warnings.begin(), estimate.warnings.end(),
                                  [&](const Warning& w) { return w.text == warning.text; });
    if (!said) estimate.warnings.push_back(warning);
  };
  for (const Dataset& data : recordings.data) {
    for (const std::string& note : data.notes) say_once({"data_treated", "note", {}, note, ""});
    for (const std::string& doubt : data.unknown_units) {
      say_once({"unknown_unit", "warning", {}, doubt, "correct the header"});
    }
  }
  const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - begin;
  const std::string json = result_json(estimate, args.strict, spent.count());
  std::string page_data;
  if (wants_pictures(args)) page_data = report_data_text(args, recordings, estimate, json);
  if (!args.report.empty()) write_page(args.report, report_page(json, page_data));
  if (!args.output.empty()) {
    std::vector<ResultFile> files{{"result.json", json}};
    if (estimate.series.time.size() > 0)
      files.push_back({"residuals.csv", residuals_csv(estimate)});
    if (estimate.course) files.push_back({"course.csv", course_csv(estimate)});
    if (!page_data.empty()) files.push_back({kReportDataFile, page_data});
    files.insert(files.end(), more_files.begin(), more_files.end());
    write_files(args.output, files);
  }
  print(args.json ? json : console_report(estimate));
  return exit_code(estimate, args.strict);
}

Estimate tune_noise(const Arguments& args, const ModelFile& model,
                    const std::vector<Dataset>& recordings, Progress& progress) {
  if (is_als(args)) {
    NoiseAlsOptions options;
    options.weighted = args.method == "als-weighted";
    options.lags = args.lags;
    options.regain = args.regain;
    options.full_matrix = args.full_matrix;
    options.sources = args.sources;
    return tune_als(model, recordings, options);
  }
  if (args.method == "bayes") {
    NoiseBayesOptions options;
    if (args.draws > 0) options.draws = args.draws;
    options.seed = static_cast<std::uint64_t>(args.seed);
    options.progress = [&](double temperature) {
      progress.show(fmt::format("from prior to posterior: {:.0f} %", 100.0 * temperature));
      return true;
    };
    return tune_bayes(model, recordings, options);
  }
  NoiseMlOptions options;
  options.starts = args.starts;
  options.seed = static_cast<std::uint64_t>(args.seed);
  options.pictures = wants_pictures(args);
  for (const Path path : {Path::direct, Path::steady, Path::compressed}) {
    if (args.path == to_string(path)) options.path = path;
  }
  options.progress = [&](int start, int iteration, double L) {
    progress.show(fmt::format("start {} of {}, iteration {}, log-likelihood {:.6f}", start,
                              args.starts, iteration, L));
    return true;
  };
  return args.method == "auto" ? tune_auto(model, recordings, options)
                               : tune_ml(model, recordings, options);
}

/// The last share of every recording, or another recording, is not fitted to.
std::vector<HeldOut> hold_out(const Arguments& args, const ModelFile& model,
                              std::vector<Dataset>& recordings) {
  std::vector<HeldOut> out;
  if (args.hold_out.empty()) return out;
  if (!args.hold_out.ends_with('%')) {
    for (Dataset& run : load_runs(args, read_files(args.hold_out), model)) {
      out.push_back({std::move(run), 0});
    }
    return out;
  }
  const double share = quantity("--hold-out", args.hold_out, "%");
  if (!(share >= 0.05 && share <= 0.8)) {
    throw InputError({}, fmt::format("--hold-out '{}' leaves too little", args.hold_out),
                     "5% to 80%");
  }
  for (Dataset& data : recordings) {
    const auto kept =
        static_cast<Eigen::Index>(std::llround((1.0 - share) * static_cast<double>(data.size())));
    // A stretch of a few rows is fitted whole.
    if (kept < 1 || kept >= data.size()) continue;
    out.push_back({data, kept});
    data = first_samples(data, kept);
  }
  if (out.empty()) {
    throw InputError({}, fmt::format("--hold-out '{}' of too few rows", args.hold_out),
                     "a longer recording");
  }
  return out;
}

int run_estimator(const Arguments& args) {
  const auto begin = std::chrono::steady_clock::now();
  ModelFile model = load_model(args);
  if (model.form == ModelFile::Form::single_track) {
    throw InputError(
        {model.path, 0, 0},
        fmt::format("'{}' is about the noise of a linear model, this is a vehicle", args.verb),
        "a model with A, C, Q, R", "use 'fit'");
  }
  if (is_als(args) || args.method == "auto") require_linear(args, model);
  for (const auto& [given, option] :
       {std::pair{args.lags > 0, "--lags"}, std::pair{args.regain, "--regain"},
        std::pair{args.sources, "--sources"}}) {
    if (!given || is_als(args)) continue;
    throw InputError({}, fmt::format("{} has no meaning with --method {}", option, args.method),
                     "--method als or als-weighted");
  }
  if (args.full_matrix && args.method != "als") {
    throw InputError({}, "--full-matrix has no meaning with --method " + args.method,
                     "--method als: it is a choice of weights, and als-weighted has its own");
  }
  Recordings recordings = load_recordings(args, model);
  if (model.time.step == 0.0) model.linear.dt = recordings.data.front().dt;
  const std::vector<HeldOut> held_out = hold_out(args, model, recordings.data);
  for (const HeldOut& held : held_out) {
    check_inputs({held.recording});
    check_period(args, model, recordings.data.front(), held.recording);
  }
  Progress progress(args);
  Estimate estimate;
  if (args.verb == "check") {
    estimate = check_filter(model, recordings.data);
  } else {
    const auto tune = [&](const std::vector<Dataset>& data) {
      return tune_noise(args, model, data, progress);
    };
    estimate = args.robust ? tune_robust(model, recordings.data, tune) : tune(recordings.data);
  }
  if (!held_out.empty()) {
    describe_hold_out(estimate, model, held_out);
    for (const Dataset& data : recordings.data) {
      const auto rows = static_cast<long>(data.size());
      estimate.inputs.push_back({data.name, "", rows, rows});
    }
  }
  if (wants_pictures(args)) picture_filter(model, recordings.data, estimate);
  progress.clear();
  return finish(args, recordings, estimate, begin);
}

int run_fit(const Arguments& args) {
  const auto begin = std::chrono::steady_clock::now();
  const ModelFile model = load_model(args);
  if (model.form != ModelFile::Form::single_track) {
    for (const auto& [given, option] :
         {std::pair{args.bootstrap > 0, std::string("--bootstrap")},
          std::pair{args.method != "ml", "--method " + args.method}}) {
      if (!given) continue;
      throw InputError({model.path, 0, 0}, option + " has no meaning here", "model: single-track",
                       "a filter is fitted by maximum likelihood");
    }
    // Free physical parameters are found by the same likelihood as the noise.
    return run_estimator(args);
  }
  Recordings recordings = load_recordings(args, model);
  VehicleFitOptions options;
  options.search.starts = args.starts;
  options.search.seed = static_cast<std::uint64_t>(args.seed);
  options.search.robust = args.robust;
  options.bootstrap = args.bootstrap;
  options.pictures = wants_pictures(args);
  if (args.method == "prediction-error") {
    options.method = VehicleFitOptions::Method::prediction_error;
  } else if (args.method == "trajectory") {
    options.method = VehicleFitOptions::Method::trajectory;
  }
  for (const HeldOut& held : hold_out(args, model, recordings.data)) {
    options.hold_out.push_back(samples_from(held.recording, held.from));
  }
  Progress progress(args);
  options.search.progress = [&](int iteration, double) {
    progress.show(fmt::format("fitting the vehicle: iteration {}", iteration));
    return true;
  };
  Estimate estimate = fit_vehicle(model, recordings.data, options);
  progress.clear();
  return finish(args, recordings, estimate, begin);
}

int run_compare(const Arguments& args) {
  const auto begin = std::chrono::steady_clock::now();
  if (!args.report.empty()) {
    throw InputError({}, "--report has no meaning with --compare", "'check' of one model");
  }
  std::vector<std::string> paths{args.model};
  Arguments view = args;
  const auto data = std::stable_partition(view.data.begin(), view.data.end(), is_model);
  paths.insert(paths.end(), view.data.begin(), data);
  view.data.erase(view.data.begin(), data);
  if (view.data.empty()) {
    throw InputError({}, "no recording on the command line",
                     "identikal check --compare A.yaml B.yaml DATA");
  }
  std::vector<ModelFile> models;
  std::vector<std::vector<Dataset>> recordings;
  Recordings loaded;
  for (const std::string& path : paths) {
    view.model = path;
    models.push_back(load_model(view));
    loaded = load_recordings(view, models.back());
    if (models.back().time.step == 0.0) models.back().linear.dt = loaded.data.front().dt;
    recordings.push_back(loaded.data);
  }
  Estimate estimate = compare_filters(models, recordings);
  return finish(args, loaded, estimate, begin);
}

int run_compare_results(const Arguments& args) {
  const auto begin = std::chrono::steady_clock::now();
  std::vector<StoredResult> results;
  for (const std::string& path : args.data) results.push_back(read_stored_result(path));
  const Estimate estimate = compare_results(results);
  const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - begin;
  print(args.json ? result_json(estimate, false, spent.count()) : console_report(estimate));
  return exit_code(estimate, false);
}

int run_filter(const Arguments& args) {
  const auto begin = std::chrono::steady_clock::now();
  if (args.smooth && args.lag >= 0) {
    throw InputError({}, "--smooth and --lag", "one of them",
                     "--smooth takes the whole recording, --lag N what came up to N samples later");
  }
  ModelFile model = load_model(args);
  require_filter(args, model);
  const Recordings recordings = load_recordings(args, model);
  if (model.time.step == 0.0) model.linear.dt = recordings.data.front().dt;
  FilterRunOptions options;
  if (args.smooth) options.lag.reset();
  if (args.lag >= 0) options.lag = args.lag;
  FilterRun run = filter_recordings(model, recordings.data, options);
  if (args.output.empty() && !args.json) {
    write_states_csv(std::cout, model, recordings.data, run);
    print("");
    return exit_code(run.estimate, args.strict);
  }
  std::vector<ResultFile> files;
  if (!args.output.empty()) {
    std::ostringstream states, innovations;
    write_states_csv(states, model, recordings.data, run);
    write_innovations_csv(innovations, recordings.data, run);
    files.push_back({"states.csv", std::move(states).str()});
    files.push_back({"innovations.csv", std::move(innovations).str()});
  }
  run.estimate.series = {};  // innovations.csv says the same
  return finish(args, recordings, run.estimate, begin, files);
}

int run_bound(const Arguments& args) {
  const auto begin = std::chrono::steady_clock::now();
  ModelFile model = load_model(args);
  require_filter(args, model);
  Recordings recordings;
  if (!args.data.empty()) {
    const std::vector<Table> files = read_files(args.data.front());
    recordings.add({load_data(args, files, model, false)}, files, parse_range(args.range));
    if (model.time.step == 0.0) model.linear.dt = recordings.data.front().dt;
  }
  const bool given = !recordings.data.empty();
  if (given == (args.rows > 0)) {
    throw InputError({},
                     given ? "both -n and a recording of inputs are given"
                           : "how many samples are planned is not said",
                     "-n SAMPLES, or a recording that holds the inputs");
  }
  BoundOptions options;
  options.samples = given ? recordings.data.front().size() : args.rows;
  if (args.runs > 0) options.runs = args.runs;
  options.seed = static_cast<std::uint64_t>(args.seed);
  const bool nonlinear = model.form == ModelFile::Form::nonlinear;
  if (args.runs > 0 && !nonlinear) {
    throw InputError({}, "--runs has no meaning here", "a nonlinear model",
                     "the bound of a linear one is exact");
  }
  if (given && !args.signals.empty()) {
    throw InputError({}, "both --input and a recording of inputs are given", "one of the two");
  }
  std::optional<Dataset> planned;
  if (given) {
    planned = recordings.data.front();
  } else if (nonlinear || !args.signals.empty()) {
    planned = signal_inputs(model, args.signals, args.rows);
    if (model.time.step == 0.0) model.linear.dt = planned->dt;
  }
  if (!args.accuracy.empty()) {
    options.accuracy = quantity("--accuracy", args.accuracy, "%");
    if (!(options.accuracy > 0.0)) {
      throw InputError({}, fmt::format("--accuracy '{}' is not above 0", args.accuracy), "10%");
    }
  }
  Estimate estimate = bound_of(model, options, planned ? &*planned : nullptr);
  return finish(args, recordings, estimate, begin);
}

int run_track(const Arguments& args) {
  const auto begin = std::chrono::steady_clock::now();
  ModelFile model = load_model(args);
  if (model.form == ModelFile::Form::nonlinear) require_linear(args, model);
  if (model.form != ModelFile::Form::linear && (args.adaptive || args.draws > 0)) {
    throw InputError(
        {}, fmt::format("{} has no meaning here", args.adaptive ? "--adaptive" : "--draws"),
        "a model with A, C, Q, R", "the model file says how the past is forgotten");
  }
  const Recordings recordings = load_recordings(args, model);
  if (model.time.step == 0.0) model.linear.dt = recordings.data.front().dt;
  Progress progress(args);
  if (model.form != ModelFile::Form::linear) {
    Estimate coefficients =
        model.form == ModelFile::Form::single_track
            ? track_vehicle(model, recordings.data.front())
            : track_regression(model, recordings.data.front(), [&](const std::string& what) {
                progress.show(what);
                return true;
              });
    progress.clear();
    return finish(args, recordings, coefficients, begin);
  }
  NoiseTrackOptions options;
  options.adaptive = args.adaptive;
  if (args.draws > 0) options.draws = args.draws;
  options.seed = static_cast<std::uint64_t>(args.seed);
  options.progress = [&](Eigen::Index sample, Eigen::Index of) {
    if (sample % 100 == 0) progress.show(fmt::format("sample {} of {}", sample, of));
    return true;
  };
  Estimate estimate = track(model, recordings.data.front(), options);
  progress.clear();
  return finish(args, recordings, estimate, begin);
}

int run_shape(const Arguments& args) {
  const auto begin = std::chrono::steady_clock::now();
  ModelFile model = load_model(args);
  require_linear(args, model);
  ShapeOptions options;
  options.most_order = args.order;
  options.seed = static_cast<std::uint64_t>(args.seed);
  if (args.place == "process") options.place = NoisePlace::process;
  if (args.place == "measurement") options.place = NoisePlace::measurement;
  options.hold_out = quantity("--hold-out", args.hold_out.empty() ? "30%" : args.hold_out, "%");
  if (!(options.hold_out >= 0.05 && options.hold_out <= 0.8)) {
    throw InputError({}, fmt::format("--hold-out '{}' leaves too little", args.hold_out),
                     "5% to 80%");
  }
  const Recordings recordings = load_recordings(args, model);
  if (model.time.step == 0.0) model.linear.dt = recordings.data.front().dt;
  Progress progress(args);
  options.progress = [&](const std::string& what) {
    progress.show(what);
    return true;
  };
  ShapeResult result = shape(model, recordings.data, options);
  progress.clear();
  if (wants_pictures(args)) {
    picture_filter(result.model ? *result.model : model, recordings.data, result.estimate);
  }
  std::vector<ResultFile> files{{"spectrum.csv", spectrum_csv(result.estimate)}};
  if (result.model) {
    const Shaping& s = *result.estimate.shaping;
    const std::string text = model_text(
        *result.model, {fmt::format("{} with a shaping filter of order {} in its {} noise, tuned.",
                                    model.name, s.order, s.place),
                        "The first states are the filter's."});
    files.push_back({"shaped.yaml", text});
    result.estimate.model_file = {"shaped.yaml", sha256_of_text(text), text, {}};
  }
  if (result.in_measurement) {
    files.push_back(
        {"shaped_measurement.yaml",
         model_text(
             *result.in_measurement,
             {"The model of shaped.yaml with its colour in the measurement noise instead: the",
              "very same outputs and likelihood, other states. Outputs alone do not tell which",
              "of the two is right. The first states are the filter's."})});
  }
  return finish(args, recordings, result.estimate, begin, files);
}

int run_report(const Arguments& args) {
  const std::filesystem::path given(args.model);
  const std::string page = rebuilt_page(args.model);
  const std::filesystem::path folder =
      std::filesystem::is_directory(given) ? given : given.parent_path();
  const std::string path = args.report.empty() ? (folder / "report.html").string() : args.report;
  write_page(path, page);
  print(fmt::format("{} written\n", path));
  return 0;
}

const std::vector<std::string> kLanguages{"cpp", "c", "matlab", "python", "yaml", "json"};

int run_export(const Arguments& args) {
  const std::optional<ExportFormat> format = export_format(args.language);
  if (!format) {
    throw InputError({}, fmt::format("--to '{}'", args.language),
                     "cpp, c, matlab, python, yaml or json",
                     did_you_mean(args.language, kLanguages));
  }
  const StoredResult result = read_stored_result(args.model, PageData::if_there);
  const std::string text = export_text(result, *format, day_of_file(result.path));
  if (args.output.empty()) {
    print(text);
  } else {
    write_page(args.output, text, "-o");
    print(fmt::format("{} written\n", args.output));
  }
  return 0;
}

int run_validate(const Arguments& args) {
  const auto begin = std::chrono::steady_clock::now();
  const StoredResult result = read_stored_result(args.model);
  const ModelFile model = estimated_model(result.estimate, result.path);
  if (model.form == ModelFile::Form::regression) {
    throw InputError({result.path, 0, 0}, "a result about a regression",
                     "a result of tune, check or fit");
  }
  if (model.form != ModelFile::Form::single_track) require_filter(args, model);
  ValidateOptions options;
  options.robust = args.robust;
  if (args.robust && model.form != ModelFile::Form::single_track) {
    throw InputError({}, "--robust has no meaning with a filter", "a result about a vehicle");
  }
  if (!args.least_fit.empty()) {
    options.least_fit = 100.0 * quantity("--fit", args.least_fit, "%");
    if (!(*options.least_fit <= 100.0)) {
      throw InputError({}, fmt::format("--fit '{}' cannot be reached", args.least_fit),
                       "at most 100%");
    }
  }
  const Recordings recordings = load_recordings(args, model);
  Estimate estimate =
      validate(result.estimate, model, recordings.data, recordings.records, options);
  return finish(args, recordings, estimate, begin);
}

int run_study(const Arguments& args) {
  Progress progress(args);
  StudyOptions options;
  options.runs = args.runs;
  options.seed = static_cast<std::uint64_t>(args.seed);
  options.threads = args.threads;
  options.progress = [&](int done, int of) {
    progress.show(fmt::format("{}: run {} of {}", args.model, done, of));
  };
  const StudyReport report = study(args.model, options);
  progress.clear();
  if (!args.output.empty()) {
    std::vector<ResultFile> files{{args.model + ".txt", report.text}};
    if (report.figure) {
      files.push_back({args.model + ".csv", report.csv});
      files.push_back({args.model + ".svg", svg(*report.figure)});
    }
    write_files(args.output, files);
  }
  print(report.text);
  return 0;
}

ManoeuvreRequest manoeuvre_request(const Arguments& args) {
  ManoeuvreRequest request;
  request.name = args.manoeuvre;
  const Manoeuvre& manoeuvre = find_manoeuvre(args.manoeuvre);
  if (!args.speed.empty()) request.speed = quantity("--speed", args.speed, "m/s");
  if (!args.duration.empty()) request.duration = quantity("--duration", args.duration, "s");
  request.rate = quantity("--rate", args.rate, "Hz");
  for (const std::string& assignment : args.manoeuvre_settings) {
    const std::size_t equals = assignment.find('=');
    if (equals == std::string::npos) {
      throw InputError({}, fmt::format("--with '{}' has no '='", assignment), "NAME=VALUE");
    }
    const ManoeuvreSetting& setting = find_setting(manoeuvre, assignment.substr(0, equals));
    request.settings[setting.name] =
        quantity("--with " + setting.name, assignment.substr(equals + 1), setting.unit);
  }
  return request;
}

std::optional<double> signal_to_noise(const std::string& text) {
  if (text.empty()) return std::nullopt;
  std::string number = text;
  if (lower_case(text).ends_with("db")) number.resize(number.size() - 2);
  return quantity("--snr", number, "");
}

int run_init(const Arguments& args) {
  std::vector<std::string> names;
  for (const ModelTemplate& each : model_templates()) names.push_back(each.name);
  if (args.model.empty()) {
    for (const ModelTemplate& each : model_templates()) {
      print(fmt::format("{}\n    {}\n", each.name, purpose_of(each)));
    }
    return 0;
  }
  const auto at = std::find(names.begin(), names.end(), args.model);
  if (at == names.end()) {
    throw InputError({}, fmt::format("unknown template '{}'", args.model),
                     fmt::format("one of {}", fmt::join(names, ", ")),
                     did_you_mean(args.model, names));
  }
  print(model_templates()[static_cast<std::size_t>(at - names.begin())].text);
  return 0;
}

int run_simulate(const Arguments& args) {
  ModelFile model = load_model(args);
  std::optional<Dataset> recording;
  if (!args.data.empty()) {
    recording = load_data(args, read_files(args.data.front()), model, false);
  }
  const Dataset* inputs = recording ? &*recording : nullptr;
  if (inputs != nullptr && model.time.step == 0.0) model.linear.dt = inputs->dt;
  const bool vehicle = model.form == ModelFile::Form::single_track;
  if (vehicle && !args.signals.empty()) {
    throw InputError({}, "--input has no meaning here", "a model of matrices or formulas",
                     "--manoeuvre drives the vehicle");
  }
  if (!args.signals.empty() && inputs != nullptr) {
    throw InputError({}, "both --input and a recording of inputs are given", "one of the two");
  }
  if (args.rows > 0 && (inputs != nullptr || vehicle)) {
    throw InputError({}, "-n has no meaning here",
                     inputs != nullptr ? "as many rows as the recording of the inputs has"
                                       : "--duration and --rate");
  }
  const bool asks_for_manoeuvre = !args.manoeuvre.empty() || !args.manoeuvre_settings.empty();
  if (asks_for_manoeuvre && (inputs != nullptr || !vehicle)) {
    throw InputError({}, "--manoeuvre and --with have no meaning here",
                     "a vehicle without a recording");
  }
  const std::optional<double> snr = signal_to_noise(args.snr);
  if (snr && !vehicle) {
    throw InputError({}, "--snr has no meaning here", "a vehicle", "a linear model has Q and R");
  }
  Simulated simulated;
  if (vehicle) {
    simulated = simulate_vehicle(model, manoeuvre_request(args), inputs, snr,
                                 static_cast<std::uint64_t>(args.seed));
  } else {
    if (inputs == nullptr && args.rows < 1) {
      throw InputError({}, "how many rows to simulate is not said", "-n ROWS");
    }
    if (inputs == nullptr && !model.inputs.empty()) {
      recording = signal_inputs(model, args.signals, args.rows);
      inputs = &*recording;
    } else if (!args.signals.empty()) {
      throw InputError({model.path, 0, 0}, "the model has no inputs", "no --input");
    }
    const auto seed = static_cast<std::uint64_t>(args.seed);
    simulated = model.form == ModelFile::Form::nonlinear
                    ? simulate_nonlinear(model, args.rows, inputs, seed)
                    : simulate_linear(model, args.rows, inputs, seed);
  }
  if (args.output.empty()) {
    print(simulated.csv);
  } else {
    write_files(args.output, {{"simulated.csv", simulated.csv}});
    print(fmt::format("{} rows written to {}\n", simulated.rows,
                      (std::filesystem::path(args.output) / "simulated.csv").string()));
    for (const std::string& note : simulated.notes) print(fmt::format("{}\n", note));
  }
  return 0;
}

// A survey of each recording, as a person or a program reads it.
int run_survey(const Arguments& args, const std::optional<ModelFile>& model,
               const std::vector<std::string>& recordings) {
  if (args.json && recordings.size() > 1) {
    throw InputError({}, fmt::format("{} recordings with --json", recordings.size()), "one");
  }
  if (model && model->form != ModelFile::Form::single_track) {
    throw InputError({model->path, 0, 0}, "--vehicle with a linear model", "model: single-track");
  }
  for (const std::string& argument : recordings) {
    const auto begin = std::chrono::steady_clock::now();
    const std::vector<Table> files = read_files(argument);
    Estimate estimate;
    estimate.verb = "info";
    estimate.status = Status::ok;
    estimate.message = "surveyed";
    Recordings records;
    if (model) {
      estimate.model_name = model->name;
      records.add(load_runs(args, files, *model), files, parse_range(args.range));
      estimate.survey = survey(vehicle_signals(*model, records.data));
    } else {
      Dataset whole;
      whole.time = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(files[0].rows));
      records.add({std::move(whole)}, files, parse_range(args.range));
      estimate.survey = survey(within(guess_vehicle(files), parse_range(args.range)));
    }
    estimate.inputs = records.records;
    const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - begin;
    if (args.json) {
      print(result_json(estimate, false, spent.count()));
    } else {
      for (const std::string& note : records.data[0].notes) print(note + "\n");
      print(argument + "\n" + survey_text(*estimate.survey));
    }
  }
  return 0;
}

int run_info(const Arguments& args) {
  std::vector<std::string> recordings = args.data;
  std::optional<ModelFile> model;
  if (const auto file = std::find_if(recordings.begin(), recordings.end(), is_model);
      file != recordings.end()) {
    model = read_model_file(*file);
    recordings.erase(file);
  }
  if (recordings.empty())
    throw InputError({}, "no recording on the command line", "identikal info [MODEL] DATA");
  if (args.vehicle) return run_survey(args, model, recordings);
  if (args.json) throw InputError({}, "--json without --vehicle", "info --vehicle DATA --json");
  std::string text;
  for (const std::string& argument : recordings) {
    const std::vector<Table> files = read_files(argument);
    for (const Table& table : files) text += describe_table(table);
    if (!model && files.size() == 1) continue;
    if (model) {
      const Dataset data = load_data(args, files, *model);
      for (const auto* notes : {&data.notes, &data.unknown_units}) {
        for (const std::string& note : *notes) text += note + "\n";
      }
      text += describe_channels(*model, data);
    } else {
      for (const std::string& note : join_tables(files, {}).notes) text += note + "\n";
    }
  }
  print(text);
  return 0;
}

std::string whole_number(const std::string& text) {
  const bool digits = !text.empty() && text.size() <= 18 &&
                      text.find_first_not_of("0123456789") == std::string::npos;
  return digits ? "" : "'" + text + "' is not a whole number from 0 to 999999999999999999";
}

std::string a_page(const std::string& text) {
  return text.empty() || text.ends_with('/') ? "no file is named" : std::string();
}

std::string a_folder(const std::string& text) {
  return text.empty() ? "no folder is named" : std::string();
}

void add_common(CLI::App& verb, Arguments& args, bool estimates, bool pictured = true) {
  verb.add_option("-o,--output", args.output, "folder for the result files")->check(a_folder);
  verb.add_option("--set", args.settings, "NAME=VALUE: value (start) of a parameter")
      ->allow_extra_args(false);
  verb.add_option("--range", args.range,
                  "FROM:TO: use these rows, in seconds from the first, e.g. 10s:95s");
  verb.add_flag("--quiet", args.quiet, "no progress line");
  if (!estimates) return;
  verb.add_flag("--json", args.json, "print the result as JSON instead of text");
  verb.add_flag("--strict", args.strict, "exit 4 when there are warnings");
  if (pictured)
    verb.add_option("--report", args.report, "FILE.html: everything as one page")->check(a_page);
}

void add_filter(CLI::App& verb, Arguments& args) {
  verb.add_option("--filter", args.filter, "of a nonlinear model")
      ->check(CLI::IsMember({"extended", "iterated", "unscented"}))
      ->default_str("extended");
}

void add_signals(CLI::App& verb, Arguments& args) {
  verb.add_option("--input", args.signals,
                  "NAME=FORMULA of the time t in s and SI, e.g. 'u=sin(2*pi*t/5)'; once per input")
      ->allow_extra_args(false);
}

// As it can be typed again.
std::string command_line(int argc, char** argv) {
  std::string out = "identikal";
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    const bool plain = !word.empty() && word.find_first_not_of(
                                            "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVW"
                                            "XYZ0123456789-_./:=+,%@^") == std::string::npos;
    std::string quoted;
    for (const char c : word) quoted += c == '\'' ? "'\\''" : std::string(1, c);
    out += plain ? " " + word : " '" + quoted + "'";
  }
  return out;
}

int run(int argc, char** argv) {
  CLI::App app{"Identikal: system identification and Kalman filter tuning from recorded data"};
  app.require_subcommand(1);
  app.set_version_flag("--version", "identikal " IDENTIKAL_VERSION);
  Arguments args;
  args.command = command_line(argc, argv);

  CLI::App* info = app.add_subcommand("info", "columns, units, rates, gaps of a recording");
  info->add_option("files", args.data, "[MODEL] DATA...")->required();
  info->add_option("--range", args.range, "FROM:TO: use these rows, in seconds from the first");
  info->add_flag("--vehicle", args.vehicle,
                 "survey of a vehicle's recording: signs, units, clocks, what can be identified");
  info->add_flag("--json", args.json, "with --vehicle: print the survey as JSON");

  CLI::App* init = app.add_subcommand(
      "init", "print a commented model file to begin with; without a name, list them");
  init->add_option("TEMPLATE", args.model, "its name");

  const std::pair<const char*, const char*> estimators[] = {
      {"tune", "estimate Q and R of a Kalman filter"},
      {"fit", "estimate physical parameters"},
      {"check", "is this filter optimal? exit 1 if not"}};
  for (const auto& [name, help] : estimators) {
    CLI::App* verb = app.add_subcommand(name, help);
    verb->add_option("MODEL", args.model, "model file (YAML)")->required();
    verb->add_option("DATA", args.data, "recordings (CSV)")->required();
    add_common(*verb, args, true);
    add_filter(*verb, args);
    if (std::string(name) == "check") {
      verb->add_flag("--compare", args.compare, "rank filters: --compare A.yaml B.yaml ... DATA");
      continue;
    }
    verb->add_option("--seed", args.seed, "seed of the scattered starts")
        ->check(whole_number)
        ->capture_default_str();
    verb->add_option("--starts", args.starts, "number of starts")
        ->check(CLI::Range(1, 1000))
        ->capture_default_str();
    verb->add_option("--hold-out", args.hold_out,
                     "recording, or last share (30%) of each, to validate on");
    if (std::string(name) == "fit") {
      verb->add_option(
              "--method", args.method,
              "output-error: simulate. For cars that wind and road push about: prediction-error, "
              "with a filter gain; trajectory, with the states of all rows unknown")
          ->check(CLI::IsMember({"output-error", "prediction-error", "trajectory"}))
          ->default_str("output-error");
      verb->add_flag("--robust", args.robust, "noise with outliers: Student's t instead of normal");
      verb->add_option("--bootstrap", args.bootstrap,
                       "draws of a block bootstrap for the errors, e.g. 500")
          ->check(CLI::Range(20, 100000));
    }
    if (std::string(name) == "tune") {
      verb->add_option("--method", args.method,
                       "ml: maximum likelihood; als-weighted, als: autocovariance least squares; "
                       "auto: ml from the start that als-weighted finds, and both compared; "
                       "bayes: posterior")
          ->check(CLI::IsMember({"ml", "als", "als-weighted", "auto", "bayes"}))
          ->capture_default_str();
      verb->add_option("--lags", args.lags, "als: autocovariances used; 0: as many as tell")
          ->check(CLI::Range(0L, 1000L));
      verb->add_option("--draws", args.draws, "bayes: draws from the posterior")
          ->check(CLI::Range(10L, 1000000L))
          ->default_str("2000");
      verb->add_flag("--robust", args.robust, "leave out samples that are outliers");
      verb->add_flag("--regain", args.regain, "als: repeat with the estimate's own gain");
      verb->add_flag("--sources", args.sources,
                     "als: Q from the fewest independent noise sources that the data allow");
      verb->add_flag("--full-matrix", args.full_matrix,
                     "als: fit the whole matrix of autocovariances, not one column");
      verb->add_option("--path", args.path, "likelihood: automatic, direct, steady, compressed")
          ->check(CLI::IsMember({"automatic", "direct", "steady", "compressed"}));
    }
  }

  CLI::App* track =
      app.add_subcommand("track", "estimate sample by sample: Q and R, a regression, a vehicle");
  track->add_option("MODEL", args.model, "model file (YAML)")->required();
  track->add_option("DATA", args.data, "recording (CSV)")->required()->expected(1);
  add_common(*track, args, true);
  track->add_flag(
      "--adaptive", args.adaptive,
      "start with the file's noise, learn it anew whenever it is found to have changed");
  track->add_option("--draws", args.draws, "filters that run side by side")
      ->check(CLI::Range(10L, 1000000L))
      ->default_str("400");
  track->add_option("--seed", args.seed, "seed of the draws")
      ->check(whole_number)
      ->capture_default_str();

  CLI::App* filter = app.add_subcommand(
      "filter",
      "states and innovations as CSV: filtered, or smoothed (without -o: states, printed)");
  filter->add_option("MODEL", args.model, "model file (YAML)")->required();
  filter->add_option("DATA", args.data, "recordings (CSV)")->required();
  filter->add_flag("--smooth", args.smooth, "states given the whole recording");
  filter->add_option("--lag", args.lag, "N: states given what was recorded up to N samples later")
      ->check(CLI::Range(0L, 1000000L));
  filter
      ->add_option("--from", args.from,
                   "RESULT: with the values that tune or fit has found, as -o has written them")
      ->check(a_folder);
  add_common(*filter, args, true, false);
  add_filter(*filter, args);

  CLI::App* comparison = app.add_subcommand(
      "compare", "rank results of one recording: AIC, BIC, likelihood ratios of nested models");
  comparison->add_option("RESULT", args.data, "result.json, or its folder; two or more")
      ->required();
  comparison->add_flag("--json", args.json, "print the result as JSON instead of text");

  CLI::App* shape = app.add_subcommand("shape", "detect coloured noise, fit a shaping filter");
  shape->add_option("MODEL", args.model, "model file (YAML)")->required();
  shape->add_option("DATA", args.data, "recordings (CSV)")->required();
  add_common(*shape, args, true);
  shape->add_option("--noise", args.place, "which noise is coloured: both are tried otherwise")
      ->check(CLI::IsMember({"both", "process", "measurement"}))
      ->capture_default_str();
  shape->add_option("--order", args.order, "highest order of a filter")
      ->check(CLI::Range(1, 4))
      ->capture_default_str();
  shape->add_option("--hold-out", args.hold_out, "last share of each recording, to compare on")
      ->default_str("30%");
  shape->add_option("--seed", args.seed, "seed of the scattered starts")
      ->check(whole_number)
      ->capture_default_str();

  CLI::App* bound = app.add_subcommand("bound", "the best that any method can do, before any data");
  bound->add_option("MODEL", args.model, "model file (YAML), its values are the truth")->required();
  bound->add_option("DATA", args.data, "recording that holds the inputs")->expected(0, 1);
  add_common(*bound, args, true, false);
  bound->add_option("-n,--samples", args.rows, "length of the recording that is planned")
      ->check(CLI::Range(1L, 1000000000L));
  bound->add_option("--accuracy", args.accuracy, "wanted: says how many samples give it, e.g. 10%");
  add_signals(*bound, args);
  bound
      ->add_option("--runs", args.runs,
                   "nonlinear models: recordings to simulate for the mean information")
      ->check(CLI::Range(2, 100000))
      ->default_str("50");
  bound->add_option("--seed", args.seed, "nonlinear models: seed of their noise")
      ->check(whole_number)
      ->capture_default_str();
  add_filter(*bound, args);

  CLI::App* report =
      app.add_subcommand("report", "rebuild the page of a result that -o has written");
  report->add_option("RESULT", args.model, "result.json, or its folder")->required();
  report->add_option("--report", args.report, "FILE.html: without it, report.html in its folder")
      ->check(a_page);

  CLI::App* to_paste =
      app.add_subcommand("export", "code to paste from a result that -o has written");
  to_paste->add_option("RESULT", args.model, "result.json, or its folder")->required();
  to_paste->add_option("--to", args.language, "cpp, c, matlab, python, yaml or json")->required();
  to_paste->add_option("-o,--output", args.output, "FILE; without it, the text is printed")
      ->check(a_page);

  CLI::App* validation = app.add_subcommand(
      "validate", "score a result on other data, nothing refitted; exit 1 if it does not hold");
  validation->add_option("RESULT", args.model, "result.json, or its folder")->required();
  validation->add_option("DATA", args.data, "recordings (CSV)")->required();
  validation->add_option(
      "--fit", args.least_fit,
      "least fit of every channel, e.g. 70%; without it a filter has to pass its tests, "
      "a vehicle to explain 50% of the yaw rate and the rest better than its mean, and to be the "
      "car that a refit finds");
  validation->add_flag("--robust", args.robust, "vehicle: outliers count little");
  validation->add_option("-o,--output", args.output, "folder for the result files")
      ->check(a_folder);
  validation->add_option("--range", args.range,
                         "FROM:TO: use these rows, in seconds from the first");
  validation->add_flag("--json", args.json, "print the result as JSON instead of text");
  validation->add_flag("--strict", args.strict, "exit 4 when there are warnings");

  CLI::App* study =
      app.add_subcommand("study", "rerun a published table or figure beside what was published");
  study->add_option("NAME", args.model, study_ranges())->required();
  study
      ->add_option("-o,--output", args.output,
                   "folder for NAME.txt, and of a figure NAME.svg and its numbers, NAME.csv")
      ->check(a_folder);
  study
      ->add_option("--runs", args.runs,
                   "repetitions of each line; without it, as many as published")
      ->check(CLI::Range(2, 100000));
  study->add_option("--seed", args.seed, "seed of the recordings")
      ->check(whole_number)
      ->capture_default_str();
  study->add_option("--threads", args.threads, "that share the repetitions; without it, all cores")
      ->check(CLI::Range(1, 1024));
  study->add_flag("--quiet", args.quiet, "no progress line");

  CLI::App* simulate = app.add_subcommand("simulate", "make data with known truth");
  simulate->add_option("MODEL", args.model, "model file (YAML)")->required();
  simulate->add_option("DATA", args.data, "recording that holds the inputs")->expected(0, 1);
  add_common(*simulate, args, false);
  simulate->add_option("--seed", args.seed, "seed of the noise")
      ->check(whole_number)
      ->capture_default_str();
  add_signals(*simulate, args);
  simulate->add_option("-n,--rows", args.rows, "rows, where no recording gives the inputs")
      ->check(CLI::Range(1L, 100000000L));
  simulate->add_option("--manoeuvre", args.manoeuvre,
                       "vehicle without DATA: one of those below; without it, the first");
  simulate
      ->add_option("--with", args.manoeuvre_settings,
                   "NAME=VALUE changes the manoeuvre, e.g. ay=3 m/s^2; a number alone is in the "
                   "unit listed below; may be repeated")
      ->allow_extra_args(false);
  simulate->add_option("--speed", args.speed, "of the manoeuvre, where it begins");
  simulate->add_option("--rate", args.rate, "sampling rate of the manoeuvre")
      ->capture_default_str();
  simulate->add_option("--duration", args.duration, "of the recording");
  simulate->add_option("--snr", args.snr,
                       "signal-to-noise ratio of every output, e.g. 30dB, instead of the model "
                       "file's noise");
  simulate->footer(manoeuvre_help());
  // Verbs that are added later would have it too.
  app.footer(
      "Exit status:\n"
      "  0  done and usable\n"
      "  1  the answer is no: not optimal, not determined, not to be trusted\n"
      "  2  mistake on the command line, in the model or in the data\n"
      "  3  not converged; the best so far is printed\n"
      "  4  --strict and there are warnings\n"
      "  5  internal error, or a result could not be written");

  // For the build, which makes the manual page and the completions of shells from all of the above.
  if (argc == 3 && std::string(argv[1]) == "--generate") {
    std::vector<std::string> drives;
    for (const Manoeuvre& m : manoeuvres()) drives.push_back(m.name);
    print(command_reference(app, argv[2], IDENTIKAL_VERSION,
                            {{"study", "NAME", study_names()},
                             {"simulate", "--manoeuvre", drives},
                             {"export", "--to", kLanguages}}));
    return 0;
  }
  if (argc > 1 && argv[1][0] != '-') {
    std::vector<std::string> verbs;
    for (const CLI::App* verb : app.get_subcommands([](const CLI::App*) { return true; })) {
      verbs.push_back(verb->get_name());
    }
    if (std::find(verbs.begin(), verbs.end(), argv[1]) == verbs.end()) {
      throw InputError({}, fmt::format("unknown verb '{}'", argv[1]),
                       fmt::format("one of {}", fmt::join(verbs, ", ")),
                       did_you_mean(argv[1], verbs));
    }
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) {  // --help, --version
      std::ostringstream text;
      app.exit(error, text, text);
      print(text.str());
      return 0;
    }
    throw InputError({}, error.what(), "",
                     "'identikal --help' and 'identikal VERB --help' show the options");
  }
  args.verb = app.get_subcommands().front()->get_name();
  if (args.verb == "info") return run_info(args);
  if (args.verb == "init") return run_init(args);
  if (args.verb == "fit") return run_fit(args);
  if (args.verb == "track") return run_track(args);
  if (args.verb == "filter") return run_filter(args);
  if (args.verb == "compare") return run_compare_results(args);
  if (args.verb == "shape") return run_shape(args);
  if (args.verb == "bound") return run_bound(args);
  if (args.verb == "study") return run_study(args);
  if (args.verb == "report") return run_report(args);
  if (args.verb == "export") return run_export(args);
  if (args.verb == "validate") return run_validate(args);
  if (args.verb == "simulate") return run_simulate(args);
  return args.compare ? run_compare(args) : run_estimator(args);
}

}  // namespace
}  // namespace identikal

int main(int argc, char** argv) {
  try {
    return identikal::run(argc, argv);
  } catch (const identikal::InputError& error) {
    std::cerr << "identikal: " << error.what() << "\n";
    return 2;
  } catch (const identikal::OutputError& error) {
    std::cerr << "identikal: " << error.what() << "\n";
    return 5;
  } catch (const std::exception& error) {
    std::cerr << "identikal: internal error: " << error.what() << "; please report it\n";
    return 5;
  }
}
