#include "command/arguments.h"

#include <algorithm>
#include <cmath>
#include <iostream>
#include <sstream>
#include <utility>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "command/manual.h"
#include "identify/model/templates.h"
#include "identify/result/export.h"
#include "identify/simulation/manoeuvres.h"
#include "lib/base/error.h"
#include "lib/base/nearest_name.h"
#include "lib/data/units.h"
#include "lib/version.h"
#include "studies/study.h"

namespace identikal {
namespace {

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

void add_info(CLI::App& app, Arguments& args) {
  CLI::App* info = app.add_subcommand("info", "columns, units, rates, gaps of a recording");
  info->add_option("files", args.data, "[MODEL] DATA...")->required();
  info->add_option("--range", args.range, "FROM:TO: use these rows, in seconds from the first");
  info->add_flag("--vehicle", args.vehicle,
                 "survey of a vehicle's recording: signs, units, clocks, what can be identified");
  info->add_flag("--json", args.json, "with --vehicle: print the survey as JSON");
}

void add_init(CLI::App& app, Arguments& args) {
  CLI::App* init = app.add_subcommand(
      "init", "print a commented model file to begin with; without a name, list them");
  init->add_option("TEMPLATE", args.model, "its name");
}

CLI::App& add_estimator(CLI::App& app, Arguments& args, const char* name, const char* help) {
  CLI::App* verb = app.add_subcommand(name, help);
  verb->add_option("MODEL", args.model, "model file (YAML)")->required();
  verb->add_option("DATA", args.data, "recordings (CSV)")->required();
  add_common(*verb, args, true);
  add_filter(*verb, args);
  return *verb;
}

void add_search(CLI::App& verb, Arguments& args) {
  verb.add_option("--seed", args.seed, "seed of the scattered starts")
      ->check(whole_number)
      ->capture_default_str();
  verb.add_option("--starts", args.starts, "number of starts")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  verb.add_option("--hold-out", args.hold_out,
                  "recording, or last share (30%) of each, to validate on");
}

void add_tune(CLI::App& app, Arguments& args) {
  CLI::App& verb = add_estimator(app, args, "tune", "estimate Q and R of a Kalman filter");
  add_search(verb, args);
  verb.add_option("--method", args.method,
                  "ml: maximum likelihood; als-weighted, als: autocovariance least squares; "
                  "auto: ml from the start that als-weighted finds, and both compared; "
                  "bayes: posterior")
      ->check(CLI::IsMember({"ml", "als", "als-weighted", "auto", "bayes"}))
      ->capture_default_str();
  verb.add_option("--lags", args.lags, "als: autocovariances used; 0: as many as tell")
      ->check(CLI::Range(0L, 1000L));
  verb.add_option("--draws", args.draws, "bayes: draws from the posterior")
      ->check(CLI::Range(10L, 1000000L))
      ->default_str("2000");
  verb.add_flag("--robust", args.robust, "leave out samples that are outliers");
  verb.add_flag("--regain", args.regain, "als: repeat with the estimate's own gain");
  verb.add_flag("--sources", args.sources,
                "als: Q from the fewest independent noise sources that the data allow");
  verb.add_flag("--full-matrix", args.full_matrix,
                "als: fit the whole matrix of autocovariances, not one column");
  verb.add_option("--path", args.path, "likelihood: automatic, direct, steady, compressed")
      ->check(CLI::IsMember({"automatic", "direct", "steady", "compressed"}));
}

void add_fit(CLI::App& app, Arguments& args) {
  CLI::App& verb = add_estimator(app, args, "fit", "estimate physical parameters");
  add_search(verb, args);
  verb.add_option(
          "--method", args.method,
          "output-error: simulate. For cars that wind and road push about: prediction-error, "
          "with a filter gain; trajectory, with the states of all rows unknown")
      ->check(CLI::IsMember({"output-error", "prediction-error", "trajectory"}))
      ->default_str("output-error");
  verb.add_flag("--robust", args.robust, "noise with outliers: Student's t instead of normal");
  verb.add_option("--bootstrap", args.bootstrap,
                  "draws of a block bootstrap for the errors, e.g. 500")
      ->check(CLI::Range(20, 100000));
}

void add_check(CLI::App& app, Arguments& args) {
  CLI::App& verb = add_estimator(app, args, "check", "is this filter optimal? exit 1 if not");
  verb.add_flag("--compare", args.compare, "rank filters: --compare A.yaml B.yaml ... DATA");
}

void add_track(CLI::App& app, Arguments& args) {
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
}

void add_filter_verb(CLI::App& app, Arguments& args) {
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
}

void add_compare(CLI::App& app, Arguments& args) {
  CLI::App* comparison = app.add_subcommand(
      "compare", "rank results of one recording: AIC, BIC, likelihood ratios of nested models");
  comparison->add_option("RESULT", args.data, "result.json, or its folder; two or more")
      ->required();
  comparison->add_flag("--json", args.json, "print the result as JSON instead of text");
}

void add_shape(CLI::App& app, Arguments& args) {
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
}

void add_bound(CLI::App& app, Arguments& args) {
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
}

void add_report_and_export(CLI::App& app, Arguments& args) {
  CLI::App* report =
      app.add_subcommand("report", "rebuild the page of a result that -o has written");
  report->add_option("RESULT", args.model, "result.json, or its folder")->required();
  report->add_option("--report", args.report, "FILE.html: without it, report.html in its folder")
      ->check(a_page);

  CLI::App* to_paste =
      app.add_subcommand("export", "code to paste from a result that -o has written");
  to_paste->add_option("RESULT", args.model, "result.json, or its folder")->required();
  to_paste->add_option("--to", args.language, export_format_list())->required();
  to_paste->add_option("-o,--output", args.output, "FILE; without it, the text is printed")
      ->check(a_page);
}

void add_validate(CLI::App& app, Arguments& args) {
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
}

void add_study(CLI::App& app, Arguments& args) {
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
}

void add_simulate(CLI::App& app, Arguments& args) {
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
}

void refuse_unknown_verb(const CLI::App& app, int argc, char** argv) {
  if (argc < 2 || argv[1][0] == '-') return;
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

}  // namespace

void print(const std::string& text) {
  std::cout << text << std::flush;
  if (!std::cout) throw OutputError("standard output: cannot write");
}

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

double percentage(const std::string& option, const std::string& text) {
  const double value = quantity(option, text, "%");
  if (!text.ends_with('%') && std::abs(value) <= 0.01) {
    throw InputError({},
                     fmt::format("{} '{}' may be {:.4g} % or {:.4g} %", option, text, 100.0 * value,
                                 1e4 * value),
                     "a number with '%'");
  }
  return value;
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

std::optional<Arguments> parse_command_line(int argc, char** argv) {
  CLI::App app{"Identikal: system identification and Kalman filter tuning from recorded data"};
  app.require_subcommand(1);
  app.set_version_flag("--version", "identikal " IDENTIKAL_VERSION);
  Arguments args;
  args.command = command_line(argc, argv);

  add_info(app, args);
  add_init(app, args);
  add_tune(app, args);
  add_fit(app, args);
  add_check(app, args);
  add_track(app, args);
  add_filter_verb(app, args);
  add_compare(app, args);
  add_shape(app, args);
  add_bound(app, args);
  add_report_and_export(app, args);
  add_validate(app, args);
  add_study(app, args);
  add_simulate(app, args);
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
    std::vector<std::string> drives, templates;
    for (const Manoeuvre& m : manoeuvres()) drives.push_back(m.name);
    for (const ModelTemplate& t : model_templates()) templates.push_back(t.name);
    print(command_reference(app, argv[2], IDENTIKAL_VERSION,
                            {{"init", "TEMPLATE", templates},
                             {"study", "NAME", study_names()},
                             {"simulate", "--manoeuvre", drives},
                             {"export", "--to", export_formats()}}));
    return std::nullopt;
  }
  refuse_unknown_verb(app, argc, argv);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) {  // --help, --version
      std::ostringstream text;
      app.exit(error, text, text);
      print(text.str());
      return std::nullopt;
    }
    throw InputError({}, error.what(), "",
                     "'identikal --help' and 'identikal VERB --help' show the options");
  }
  args.verb = app.get_subcommands().front()->get_name();
  return args;
}

}  // namespace identikal
