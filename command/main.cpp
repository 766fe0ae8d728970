// What does each verb do? Every exception ends here.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <iostream>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sys/stat.h>
#include <unistd.h>

#include "command/arguments.h"
#include "command/info.h"
#include "command/load.h"
#include "command/output_files.h"
#include "identify/colour/shape.h"
#include "identify/filter/outliers.h"
#include "identify/filter/pictures.h"
#include "identify/filter/recordings_check.h"
#include "identify/filter/run.h"
#include "identify/filter/simulated_fit.h"
#include "identify/model/included_files.h"
#include "identify/model/model_file.h"
#include "identify/model/templates.h"
#include "identify/model/yaml_reader.h"
#include "identify/noise/als.h"
#include "identify/noise/auto.h"
#include "identify/noise/bayes.h"
#include "identify/noise/ml.h"
#include "identify/noise/track.h"
#include "identify/optimality/bound.h"
#include "identify/optimality/check.h"
#include "identify/optimality/compare_filters.h"
#include "identify/regression/track.h"
#include "identify/report/console.h"
#include "identify/report/page.h"
#include "identify/report/survey_text.h"
#include "identify/result/csv.h"
#include "identify/result/estimated_model.h"
#include "identify/result/export.h"
#include "identify/result/file.h"
#include "identify/result/file_digest.h"
#include "identify/result/json.h"
#include "identify/result/schema.h"
#include "identify/simulation/manoeuvres.h"
#include "identify/simulation/simulate.h"
#include "identify/survey/columns.h"
#include "identify/survey/survey.h"
#include "identify/validation/compare_results.h"
#include "identify/validation/validate.h"
#include "identify/vehicle/fit.h"
#include "identify/vehicle/track.h"
#include "lib/base/error.h"
#include "lib/base/nearest_name.h"
#include "lib/data/csv.h"
#include "lib/data/dataset.h"
#include "lib/data/join.h"
#include "lib/data/units.h"
#include "studies/figure.h"
#include "studies/study.h"

namespace identikal {
namespace {

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
// A result over the model or the recording that it is of would be the end of both.
void write_results(const Arguments& args, const std::vector<OutputFile>& files,
                   const Estimate& of = {}) {
  std::vector<std::string> inputs = args.data;
  inputs.push_back(args.model);
  for (const InputRecord& input : of.inputs) inputs.push_back(input.path);
  if (of.model_file) inputs.push_back(of.model_file->path);
  write_files(files, inputs);
}

bool wants_pictures(const Arguments& args) {
  const bool pictured =
      args.verb != "bound" && args.verb != "filter" && args.verb != "validate" && !args.compare;
  return pictured && (!args.report.empty() || !args.output.empty());
}

std::string report_data_text(const Arguments& args, const Recordings& recordings,
                             const Estimate& estimate, const std::string& json) {
  return report_data_json(report_data(estimate, recordings.data, recordings.held_out,
                                      {args.command, args.model, sha256_of_file(args.model)}),
                          json);
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
  for (const Warning& warning : recordings.warnings) say_once(warning);
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
  std::vector<OutputFile> written;
  if (!args.report.empty()) {
    written.push_back({args.report, report_page(json, page_data), "--report"});
  }
  if (!args.output.empty()) {
    std::vector<ResultFile> files{{"result.json", json}};
    if (estimate.series.time.size() > 0)
      files.push_back({"residuals.csv", residuals_csv(estimate)});
    if (estimate.time_history) files.push_back({"course.csv", course_csv(estimate)});
    if (!page_data.empty()) files.push_back({kReportDataFile, page_data});
    files.insert(files.end(), more_files.begin(), more_files.end());
    const std::vector<OutputFile> of_folder = in_folder(args.output, files);
    written.insert(written.end(), of_folder.begin(), of_folder.end());
  }
  write_results(args, written);
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
  if (model.form == ModelFile::Form::nonlinear && args.path != Arguments{}.path) {
    throw InputError({}, "--path has no meaning here", "a linear model",
                     "the likelihood of a nonlinear one has one path");
  }
  if (args.full_matrix && args.method != "als") {
    throw InputError({}, "--full-matrix has no meaning with --method " + args.method,
                     "--method als: it is a choice of weights, and als-weighted has its own");
  }
  Recordings recordings = load_recordings(args, model);
  if (model.time.step == 0.0) model.linear.dt = recordings.data.front().dt;
  const std::vector<HeldOut> held_out = hold_out(args, model, recordings);
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
    for (const HeldOut& held : held_out) {
      recordings.held_out.push_back(samples_from(held.recording, held.from));
    }
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
  for (const HeldOut& held : hold_out(args, model, recordings)) {
    options.hold_out.push_back(samples_from(held.recording, held.from));
  }
  recordings.held_out = options.hold_out;
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
    std::vector<Warning>& warnings = run.estimate.warnings;
    warnings.insert(warnings.begin(), recordings.warnings.begin(), recordings.warnings.end());
    for (const Warning& w : warnings) {
      if (w.severity != "note") std::cerr << "identikal: " << w.severity << ": " << w.text << "\n";
    }
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
    options.accuracy = percentage("--accuracy", args.accuracy);
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
  if (args.place == "process") options.place = NoiseSource::process;
  if (args.place == "measurement") options.place = NoiseSource::measurement;
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
                                    model.name, s.order, s.noise_source),
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
  std::error_code ignored;
  const std::filesystem::path folder =
      std::filesystem::is_directory(given, ignored) ? given : given.parent_path();
  const std::string path = args.report.empty() ? (folder / "report.html").string() : args.report;
  write_results(args, {{path, page, "--report"}});
  print(fmt::format("{} written\n", path));
  return 0;
}

int run_export(const Arguments& args) {
  const std::optional<ExportFormat> format = export_format(args.language);
  if (!format) {
    throw InputError({}, fmt::format("--to '{}'", args.language), export_format_list(),
                     did_you_mean(args.language, export_formats()));
  }
  const StoredResult result = read_stored_result(args.model, PageData::if_there);
  const std::string text = export_text(result, *format, day_of_file(result.path));
  if (args.output.empty()) {
    print(text);
  } else {
    write_results(args, {{args.output, text}}, result.estimate);
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
  if (result.estimate.verb == "bound") {
    throw InputError({result.path, 0, 0}, "a result of 'bound', which has estimated nothing",
                     "a result of tune, check or fit");
  }
  if (model.form != ModelFile::Form::single_track) require_filter(args, model);
  ValidateOptions options;
  options.robust = args.robust;
  if (args.robust && model.form != ModelFile::Form::single_track) {
    throw InputError({}, "--robust has no meaning with a filter", "a result about a vehicle");
  }
  if (!args.least_fit.empty()) {
    options.least_fit = 100.0 * percentage("--fit", args.least_fit);
    if (!(*options.least_fit <= 100.0)) {
      throw InputError({}, fmt::format("--fit '{}' cannot be reached", args.least_fit),
                       "at most 100%");
    }
    if (!(*options.least_fit > 0.0)) {
      throw InputError({}, fmt::format("--fit '{}' asks for nothing", args.least_fit), "above 0%");
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
    write_results(args, in_folder(args.output, files));
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

// Options that this model, with or without a recording of inputs, gives no meaning to.
void check_simulate_options(const Arguments& args, bool vehicle, bool inputs) {
  if (vehicle && !args.signals.empty()) {
    throw InputError({}, "--input has no meaning here", "a model of matrices or formulas",
                     "--manoeuvre drives the vehicle");
  }
  if (!args.signals.empty() && inputs) {
    throw InputError({}, "both --input and a recording of inputs are given", "one of the two");
  }
  if (args.rows > 0 && (inputs || vehicle)) {
    throw InputError(
        {}, "-n has no meaning here",
        inputs ? "as many rows as the recording of the inputs has" : "--duration and --rate");
  }
  const bool asks_for_manoeuvre = !args.manoeuvre.empty() || !args.manoeuvre_settings.empty();
  if (asks_for_manoeuvre && (inputs || !vehicle)) {
    throw InputError({}, "--manoeuvre and --with have no meaning here",
                     "a vehicle without a recording");
  }
  if (!args.snr.empty() && !vehicle) {
    throw InputError({}, "--snr has no meaning here", "a vehicle", "a linear model has Q and R");
  }
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
  check_simulate_options(args, vehicle, inputs != nullptr);
  Simulated simulated;
  if (vehicle) {
    simulated = simulate_vehicle(model, manoeuvre_request(args), inputs, signal_to_noise(args.snr),
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
    write_results(args, in_folder(args.output, {{"simulated.csv", simulated.csv}}));
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
    estimate.notes = records.data[0].notes;
    const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - begin;
    if (args.json) {
      print(result_json(estimate, false, spent.count()));
    } else {
      for (const std::string& note : estimate.notes) print(note + "\n");
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

int run(int argc, char** argv) {
  const std::optional<Arguments> given = parse_command_line(argc, argv);
  if (!given) return 0;
  const Arguments& args = *given;
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
