// simulate: recordings with known truth.
#include "identify/simulation/simulate.h"

#include <filesystem>
#include <memory>
#include <optional>
#include <sstream>

#include "jobs/output_files.h"
#include "jobs/quantity.h"
#include "jobs/run.h"
#include "jobs/verbs.h"
#include <fmt/format.h>

#include "identify/simulation/impulse_response.h"
#include "identify/simulation/manoeuvres.h"
#include "lib/base/error.h"
#include "lib/base/nearest_name.h"

namespace identikal {
namespace {

const char* const kRate = "100 Hz";

struct SimulateOptions {
  ModelOptions model;
  std::string inputs, range;  // a recording of the inputs
  std::string folder;
  std::int64_t seed = 1;
  std::vector<std::string> signals;
  std::int64_t rows = 0;
  std::string manoeuvre, speed, rate, duration, snr, impulse;
  std::vector<std::string> manoeuvre_settings;
};

ManoeuvreRequest manoeuvre_request(const SimulateOptions& options) {
  ManoeuvreRequest request;
  request.name = options.manoeuvre;
  const Manoeuvre& manoeuvre = find_manoeuvre(options.manoeuvre);
  if (!options.speed.empty()) request.speed = quantity("--speed", options.speed, "m/s");
  if (!options.duration.empty()) request.duration = quantity("--duration", options.duration, "s");
  request.rate = quantity("--rate", options.rate.empty() ? kRate : options.rate, "Hz");
  refuse_twice("--with", options.manoeuvre_settings);
  for (const std::string& assignment : options.manoeuvre_settings) {
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
  try {
    return quantity("--snr", number, "");
  } catch (const InputError&) {
    throw InputError({}, fmt::format("--snr '{}' is not a ratio", text), "decibels, e.g. 30dB");
  }
}

// Those of a manoeuvre, where none is driven.
void check_manoeuvre_options(const SimulateOptions& options, bool vehicle, bool inputs) {
  if (vehicle && !inputs) return;
  for (const auto& [given, name] :
       {std::pair{!options.manoeuvre.empty(), "--manoeuvre"},
        std::pair{!options.manoeuvre_settings.empty(), "--with"},
        std::pair{!options.speed.empty(), "--speed"}, std::pair{!options.rate.empty(), "--rate"},
        std::pair{!options.duration.empty(), "--duration"}}) {
    if (!given) continue;
    throw InputError({},
                     fmt::format("{} does not apply {}", name,
                                 vehicle ? "with a recording of inputs" : "to this model"),
                     "a vehicle without a recording");
  }
}

// Options that do not apply to this model, with or without a recording of inputs.
void check_options(const SimulateOptions& options, bool vehicle, bool inputs) {
  if (vehicle && !options.signals.empty()) {
    throw InputError({}, "--input does not apply to a vehicle", "a model of matrices or formulas",
                     "--manoeuvre drives the vehicle");
  }
  if (!options.signals.empty() && inputs) {
    throw InputError({}, "both --input and a recording of inputs are given", "one of the two");
  }
  if (options.rows > 0 && (inputs || vehicle)) {
    throw InputError(
        {},
        inputs ? "-n does not apply with a recording of inputs" : "-n does not apply to a vehicle",
        inputs ? "as many rows as the recording has" : "--duration and --rate");
  }
  if (!options.range.empty() && !inputs) {
    throw InputError({}, "--range does not apply without a recording", "a recording of the inputs");
  }
  check_manoeuvre_options(options, vehicle, inputs);
  if (!options.snr.empty() && !vehicle) {
    throw InputError({}, "--snr does not apply to this model", "a vehicle",
                     "a linear model has Q and R");
  }
}

Simulated simulate_filter(const SimulateOptions& options, const Model& model,
                          std::optional<Dataset> inputs) {
  if (!inputs && options.rows < 1) {
    throw InputError({}, "the number of rows is missing", "-n ROWS");
  }
  if (!inputs && !model.inputs.empty()) {
    refuse_twice("--input", options.signals);
    inputs = signal_inputs(model, options.signals, options.rows);
  } else if (!options.signals.empty()) {
    throw InputError({model.source, 0, 0}, "the model has no inputs", "no --input");
  }
  const auto seed = static_cast<std::uint64_t>(options.seed);
  const Dataset* given = inputs ? &*inputs : nullptr;
  return is_formula_model(model) ? simulate_nonlinear(model, options.rows, given, seed)
                                 : simulate_linear(model, options.rows, given, seed);
}

// Its columns, as they are written.
NamedSeries simulated_series(const std::string& csv) {
  const Table table = parse_csv(csv, "simulated.csv");
  NamedSeries out{"simulated", {}};
  out.values.resize(static_cast<Eigen::Index>(table.rows),
                    static_cast<Eigen::Index>(table.columns.size()));
  for (std::size_t j = 0; j < table.columns.size(); ++j) {
    out.values.col(static_cast<Eigen::Index>(j)) = Eigen::Map<const Eigen::VectorXd>(
        table.columns[j].values.data(), static_cast<Eigen::Index>(table.rows));
  }
  return out;
}

// An impulse needs no recording, and no noise is drawn.
Outcome impulse(const SimulateOptions& options, const Model& model, Call& call) {
  for (const auto& [given, name] : {std::pair{!options.inputs.empty(), "a recording of inputs"},
                                    std::pair{!options.signals.empty(), "--input"},
                                    std::pair{!options.manoeuvre.empty(), "--manoeuvre"},
                                    std::pair{!options.snr.empty(), "--snr"}}) {
    if (!given) continue;
    throw InputError({}, fmt::format("{} does not apply beside --impulse", name), "one of the two");
  }
  if (options.rows < 1) throw InputError({}, "the number of rows is missing", "-n ROWS");
  const ParameterErrors errors =
      options.model.from.empty()
          ? ParameterErrors{}
          : parameter_errors(call.inputs.result(options.model.from).estimate, model);
  std::ostringstream csv;
  write_impulse_csv(csv, impulse_response(model, options.impulse, options.rows, errors));
  Outcome out;
  out.text = std::move(csv).str();
  if (options.folder.empty()) return out;
  write_files(in_folder(options.folder, {{"impulse.csv", out.text}}),
              model_and_included(options.model.file, call.inputs));
  out.text = fmt::format("{} rows written to {}\n", options.rows,
                         (std::filesystem::path(options.folder) / "impulse.csv").string());
  return out;
}

// A step to 51 of a column that the model takes 50 off is one to 1.
void tell_of_scaled_inputs(const SimulateOptions& options, const Model& model, const Call& call) {
  if (options.signals.empty()) return;
  for (const ChannelSource& each : model.inputs) {
    if (each.scale == 1.0 && each.offset == 0.0) continue;
    notice(
        call,
        fmt::format("note: --input {0} is what the model sees: column '{1}' times {2:g} plus {3:g}",
                    each.name, each.column, each.scale, each.offset));
  }
}

Outcome simulate(const SimulateOptions& options, Call& call) {
  Model model = load_model(options.model, "simulate", call.inputs);
  if (!options.impulse.empty()) return impulse(options, model, call);
  std::optional<Dataset> inputs;
  std::vector<std::string> read = model_and_included(options.model.file, call.inputs);
  if (!options.inputs.empty()) {
    const std::vector<Table> files = read_files(options.inputs, call.inputs);
    inputs = load_data(files, model, parse_range(options.range), false);
    for (const Table& file : files) read.push_back(file.path);
    take_period(model, *inputs);
  }
  const bool vehicle = is_vehicle(model);
  check_options(options, vehicle, inputs.has_value());
  tell_of_scaled_inputs(options, model, call);
  const Simulated simulated =
      vehicle
          ? simulate_vehicle(model, manoeuvre_request(options), inputs ? &*inputs : nullptr,
                             signal_to_noise(options.snr), static_cast<std::uint64_t>(options.seed))
          : simulate_filter(options, model, std::move(inputs));
  Outcome out;
  if (call.wants_series) out.series.push_back(simulated_series(simulated.csv));
  if (options.folder.empty()) {
    out.text = simulated.csv;
    return out;
  }
  write_files(in_folder(options.folder, {{"simulated.csv", simulated.csv}}), read);
  out.text = fmt::format("{} rows written to {}\n", simulated.rows,
                         (std::filesystem::path(options.folder) / "simulated.csv").string());
  for (const std::string& note : simulated.notes) out.text += note + "\n";
  return out;
}

}  // namespace

Verb simulate_verb() {
  const auto options = std::make_shared<SimulateOptions>();
  Verb verb{"simulate", "Simulate a recording whose truth is known; without -o, print it.",
            manoeuvre_help()};
  add_model(verb, options->model);
  add_input_recording(verb, options->inputs);
  add_output(verb, options->folder);
  add_folder(verb, "--from", options->model.from,
             "Take the values that 'tune' or 'fit' has found: the result that -o has written.");
  add_settings(verb, options->model);
  add_range(verb, options->range);
  add_seed(verb, options->seed, "Seed of the noise.");
  add_signals(verb, options->signals);
  add_number(verb, "-n,--rows", options->rows, 1, 100000000,
             "Number of rows, where no recording gives the inputs.");
  add_text(verb, "--impulse", options->impulse,
           "Instead, print how the outputs answer to a unit impulse of this input, or of the noise "
           "that drives this state; with --from, with 95 % intervals.");
  add_text(verb, "--manoeuvre", options->manoeuvre,
           "Vehicle: Drive this manoeuvre, one of those below. Without it, the first.");
  add_repeated(verb, "--with", options->manoeuvre_settings,
               "Change a setting of the manoeuvre: NAME=VALUE, e.g. ay=3 m/s^2; a number alone is "
               "in the unit listed below. May be repeated.");
  add_text(verb, "--speed", options->speed, "Begin the manoeuvre at this speed, in m/s.");
  add_text(verb, "--rate", options->rate, "Sample the manoeuvre at this rate, in Hz.", kRate);
  add_text(verb, "--duration", options->duration, "Record for this time, in s.");
  add_text(verb, "--snr", options->snr,
           "Vehicle: Add noise of this signal-to-noise ratio in dB, e.g. 30dB, to every output "
           "instead of the model file's noise.");
  verb.run = [options](Call& call) { return simulate(*options, call); };
  return verb;
}

}  // namespace identikal
