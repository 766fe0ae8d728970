#include "identify/simulation/simulate.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <span>
#include <stdexcept>
#include <string_view>
#include <vector>

#include <fmt/format.h>

#include "identify/estimate/parameter_table.h"
#include "identify/filter/changing_recordings.h"
#include "identify/filter/nonlinear_recordings.h"
#include "identify/model/check.h"
#include "identify/model/model_values.h"
#include "identify/model/output_conditions.h"
#include "identify/vehicle/output_error.h"
#include "lib/base/interpolation.h"
#include "lib/base/nearest_name.h"
#include "lib/base/random.h"
#include "lib/data/units.h"
#include "lib/filter/simulation.h"
#include "lib/vehicle/late_sensor.h"
#include "lib/vehicle/sensor.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// One column of the file: values are SI.
struct OutputColumn {
  std::string name, unit;
  VectorXd values;
};

// "3" stands for the third column of a file; a simulated file needs a name for it.
std::string column_name(const ChannelSource& source) {
  const std::string& name = source.column;
  const bool number =
      std::all_of(name.begin(), name.end(), [](unsigned char c) { return std::isdigit(c) != 0; });
  return number ? "column_" + name : name;
}

// What the recorder writes: scale, offset and delay of the model file make of it what the model
// sees.
void record(const std::vector<ChannelSource>& sources, const VectorXd& time,
            std::vector<OutputColumn>& columns) {
  for (const ChannelSource& source : sources) {
    const auto column = std::find_if(columns.begin(), columns.end(), [&](const OutputColumn& c) {
      return c.name == column_name(source);
    });
    if (column == columns.end()) continue;
    const Unit unit = unit_or_dimensionless(column->unit);
    if (source.delay != 0.0) {
      column->values = interpolate_linearly(time, column->values, time.array() - source.delay,
                                            kBridgedPeriods * own_period(time, column->values));
    }
    if (source.scale == 1.0 && source.offset == 0.0) continue;
    for (double& x : column->values) {
      x = unit.to_si((unit.from_si(x) - source.offset) / source.scale);
    }
  }
}

std::string csv_text(const Model& model, std::uint64_t seed, const std::vector<std::string>& notes,
                     const VectorXd& time, std::vector<OutputColumn> columns) {
  record(model.inputs, time, columns);
  record(model.outputs, time, columns);
  std::string out = fmt::format("# simulated from '{}', seed {}\n", model.name, seed);
  for (const std::string& note : notes) out += "# " + note + "\n";
  for (const ReportedEntries entries = reported_entries(model.parameters);
       const std::string& name : entries.names) {
    const auto i = static_cast<std::size_t>(&name - entries.names.data());
    const Unit unit = unit_or_dimensionless(entries.units[i]);
    out += fmt::format("# truth: {} = {:.10g} {}\n", name, unit.from_si(entries.value[i]),
                       entries.units[i]);
  }
  for (std::size_t c = 0; c < columns.size(); ++c) {
    const std::string unit = columns[c].unit.empty() ? "" : " [" + columns[c].unit + "]";
    out += (c > 0 ? "," : "") + columns[c].name + unit;
  }
  out += "\n";
  const Index rows = columns.empty() ? 0 : columns[0].values.size();
  for (Index t = 0; t < rows; ++t) {
    for (std::size_t c = 0; c < columns.size(); ++c) {
      const Unit unit = unit_or_dimensionless(columns[c].unit);
      out += fmt::format("{}{:.10g}", c > 0 ? "," : "", unit.from_si(columns[c].values[t]));
    }
    out += "\n";
  }
  return out;
}

OutputColumn time_column(const Model& model, const VectorXd& time) {
  return {model.time.column.empty() ? "time" : model.time.column,
          model.time.unit.empty() ? "s" : model.time.unit, time};
}

VectorXd sample_times(const Dataset* inputs, Index N, double step) {
  return inputs != nullptr
             ? inputs->time
             : VectorXd(VectorXd::LinSpaced(N, 0.0, static_cast<double>(N - 1) * step));
}

void check_rows(Index rows, const Dataset* inputs) {
  if (inputs != nullptr || rows > 0) return;
  throw std::invalid_argument(fmt::format("rows is {}; expected 1 or more", rows));
}

double sampling_period(const Model& model) {
  if (model.time.step > 0.0) return model.time.step;
  throw InputError(model.time.at, "the sampling period is not known",
                   "time: {step: 0.1 s}, or a recording that holds the inputs");
}

// Outputs and inputs as the recorder writes them. Columns that the model names by number must stand
// where it says, so time comes last.
std::string csv_of(const Model& model, std::uint64_t seed, const MatrixXd& y, const Dataset* inputs,
                   const VectorXd& time) {
  std::vector<OutputColumn> columns;
  for (Index i = 0; i < y.rows(); ++i) {
    const ChannelSource& source = model.outputs[i];
    if (source.value) continue;
    columns.push_back({column_name(source), source.unit, y.row(i).transpose()});
    for (double& value : columns.back().values) value = before_transform(source.transform, value);
  }
  for (std::size_t i = 0; i < model.inputs.size(); ++i) {
    const ChannelSource& source = model.inputs[i];
    columns.push_back(
        {column_name(source), source.unit, inputs->u.row(static_cast<Index>(i)).transpose()});
  }
  std::vector<std::string> notes = describe_conditions(model);
  for (const ChannelSource& flag : model.flags) {
    columns.push_back({column_name(flag), flag.unit, VectorXd::Zero(time.size())});
    notes.push_back(fmt::format("flag {} is 0 throughout", flag.name));
  }
  columns.push_back(time_column(model, time));
  return csv_text(model, seed, notes, time, columns);
}

// The recording with its intervals cut into pieces, inputs as the model has them between samples.
Dataset refined(const Dataset& recording, InputPath path, int pieces) {
  const InputNodes nodes =
      input_nodes(recording.time, recording.u, path,
                  std::vector<int>(static_cast<std::size_t>(recording.size() - 1), pieces));
  Dataset out = recording;
  const Index N = recording.size(), M = (N - 1) * pieces + 1;
  out.time.resize(M);
  out.u.resize(recording.u.rows(), M);
  for (Index k = 0; k + 1 < N; ++k) {
    for (Index j = 0; j < pieces; ++j) {
      const double share = static_cast<double>(j) / pieces;
      out.time[k * pieces + j] =
          recording.time[k] + share * (recording.time[k + 1] - recording.time[k]);
      out.u.col(k * pieces + j) = nodes.u.col(nodes.first[k] + 2 * j);
    }
  }
  out.time[M - 1] = recording.time[N - 1];
  out.u.col(M - 1) = recording.u.col(N - 1);
  return out;
}

}  // namespace

namespace {

MatrixXd linear_outputs(const Model& model, const StateSpace& system, const MatrixXd& u, Index rows,
                        Random& random) {
  const LinearModel& linear = as_linear(model);
  try {
    return simulate_outputs(system, linear.initial, model_inputs(linear, u), rows, random);
  } catch (const std::invalid_argument&) {
    throw InputError(
        {model.source, 0, 0}, "the model cannot be simulated",
        "[Q S; S' R] positive semidefinite, and a stable A with 'initial: stationary'");
  }
}

}  // namespace

Simulated simulate_linear(const Model& given, Index rows, const Dataset* inputs,
                          std::uint64_t seed) {
  check_rows(rows, inputs);
  const Model model = checked_with_inputs(given, inputs);
  const LinearModel& linear = as_linear(model);
  const StateSpace system = instantiate(linear, model.parameters);
  const Location at{model.source, 0, 0};
  if (!model.inputs.empty() && inputs == nullptr) {
    throw InputError(at, "the model has inputs", "a recording that holds them",
                     "add it to the command line");
  }
  const Index N = inputs != nullptr ? inputs->size() : rows;
  Random random(seed);
  const MatrixXd u = inputs != nullptr ? inputs->u : MatrixXd(0, N);
  const MatrixXd y = linear_outputs(model, system, u, N, random);
  return {csv_of(model, seed, y, inputs, sample_times(inputs, N, system.dt)), N, {}};
}

Dataset signal_inputs(const Model& model, const std::vector<std::string>& signals, Index rows) {
  if (rows < 1) throw InputError({}, "the number of rows to simulate is missing", "-n ROWS");
  const double step = sampling_period(model);
  Dataset out;
  out.name = model.name;
  out.dt = step;
  out.time = sample_times(nullptr, rows, step);
  out.u = MatrixXd::Constant(static_cast<Index>(model.inputs.size()), rows, kNone);
  const std::vector<std::string> symbols{"t"};
  std::vector<std::string> names;
  for (const ChannelSource& input : model.inputs) names.push_back(input.name);
  for (const std::string& signal : signals) {
    const std::size_t equals = signal.find('=');
    const std::string what = fmt::format("--input '{}'", signal);
    if (equals == std::string::npos) throw InputError({}, what, "NAME=FORMULA of t");
    const std::string name(trimmed(std::string_view(signal).substr(0, equals)));
    const auto input = std::find(names.begin(), names.end(), name);
    if (input == names.end()) {
      throw InputError({}, fmt::format("{}: the model has no input '{}'", what, name), "",
                       did_you_mean(name, names));
    }
    Expression formula;
    try {
      formula = parse_expression(std::string_view(signal).substr(equals + 1), symbols);
    } catch (const FormulaError& error) {
      throw InputError({}, fmt::format("{}: {}", what, error.what()));
    }
    for (Index t = 0; t < rows; ++t) {
      const double value = evaluate(formula, std::span(&out.time[t], 1));
      if (!std::isfinite(value)) {
        throw InputError({}, fmt::format("{} has no value at {:.6g} s", what, out.time[t]));
      }
      out.u(input - names.begin(), t) = value;
    }
  }
  for (std::size_t i = 0; i < names.size(); ++i) {
    out.inputs.push_back({names[i], model.inputs[i].unit});
    if (!out.u.row(static_cast<Index>(i)).hasNaN()) continue;
    throw InputError({}, fmt::format("input '{}' is not given", names[i]),
                     "a recording that holds it, or --input " + names[i] + "=FORMULA");
  }
  return out;
}

MatrixXd simulated_outputs(const Model& model, const Dataset& recording, Random& random) {
  check_inputs(model, recording);
  const Location at{model.source, 0, 0};
  const Index N = recording.size();
  if (!recording.u.allFinite()) {
    throw InputError({recording.name, 0, 0}, "an input is missing in some row",
                     "every input in every row", "select rows with --range");
  }
  if (is_linear(model)) {
    const StateSpace system = instantiate(as_linear(model), model.parameters);
    return linear_outputs(model, system, recording.u, N, random);
  }
  if (changes(model)) {
    try {
      return simulate_changing_outputs(model, recording, random);
    } catch (const std::invalid_argument&) {
      throw InputError(at, "the model cannot be simulated",
                       "[Q S; S' R] positive semidefinite at every sample, and a stable A with "
                       "'initial: stationary'");
    }
  }
  const FormulaModel& formulas = as_formulas(model);
  // A dose belongs to a row of the recording, and would be given again in each piece.
  const bool doses = formulas.equations.doses.values > 0;
  // A late input is read where rows are, as in fits.
  const bool by_rows = doses || !formulas.late.empty();
  const int pieces = formulas.equations.continuous && !by_rows ? 10 : 1;
  const Dataset fine = refined(recording, formulas.inputs, pieces);
  NonlinearRealisation found;
  try {
    found = simulate_nonlinear_outputs(model, fine, random);
  } catch (const std::invalid_argument&) {
    throw InputError(at, "the model cannot be simulated", "covariances positive semidefinite");
  }
  MatrixXd y(found.y.rows(), N);
  for (Index t = 0; t < N; ++t) y.col(t) = found.y.col(t * pieces);
  if (!y.allFinite()) {
    Index t = 0;
    while (y.col(t).allFinite()) ++t;
    throw InputError(
        at, fmt::format("the motion diverges: at {:.6g} s it is not finite", fine.time[t * pieces]),
        "values that can be simulated");
  }
  return y;
}

Simulated simulate_nonlinear(const Model& given, Index rows, const Dataset* inputs,
                             std::uint64_t seed) {
  check_rows(rows, inputs);
  const Model model = checked_with_inputs(given, inputs);
  const Index N = inputs != nullptr ? inputs->size() : rows;
  Dataset recording;
  if (inputs != nullptr) {
    recording = *inputs;
  } else {
    recording.name = model.name;
    recording.dt = sampling_period(model);
    recording.time = sample_times(nullptr, N, recording.dt);
    recording.u = MatrixXd(0, N);
  }
  Random random(seed);
  const MatrixXd y = simulated_outputs(model, recording, random);
  return {csv_of(model, seed, y, inputs, recording.time), N, {}};
}

namespace {

// What a sensor shows along a drive. One that filters, or is late, is read at every step of the
// integration.
VectorXd shown_by(const VehicleSensor& sensor, const SingleTrack<>& car,
                  const DrivenRecord& driven) {
  const VehicleReading reading(sensor, car);
  const SensorFault<>& fault = car.sensors[static_cast<std::size_t>(sensor.quantity)];
  const Index N = driven.time.size();
  if (fault.lag == 0.0 && fault.delay == 0.0) {
    VectorXd out(N);
    for (Index t = 0; t < N; ++t) out[t] = reading.value(driven.motion[t], driven.vx[t]);
    return out;
  }
  const IntegrationDemand demand{decay_rate_times_speed(car), car.relaxation_length};
  const DrivenSegment segment =
      drive(driven.time, driven.steering, driven.vx, demand, car.steering_delay, car.steering_lag);
  const VectorXd time = times_of_steps(segment, driven.time);
  SignalRows felt(time.size(), 1);
  simulate(
      car, with_every_step(segment), driven.motion[0].vy, driven.motion[0].r,
      [&](Index k, const Motion& motion, double vx) { felt(k, 0) = reading.value(motion, vx); });
  filter_by_lag(time, fault.lag, felt);
  return late(time, felt, driven.time, fault.delay);
}

}  // namespace

Simulated simulate_vehicle(const Model& given, const ManoeuvreRequest& request,
                           const Dataset* inputs, std::optional<double> snr, std::uint64_t seed) {
  const Model model = checked_with_inputs(given, inputs);
  const VehicleModel& car_model = as_vehicle(model);
  if (has_measured_roll(model)) {
    throw InputError(model.inputs[2].at, "simulate with the input roll",
                     "roll: {gradient: ...}, which follows the motion");
  }
  const VehicleUnknowns vehicle = vehicle_unknowns(model);
  DrivenRecord driven;
  if (inputs != nullptr) {
    const VectorXd angle = inputs->u.row(0).transpose(), vx = inputs->u.row(1).transpose();
    if (!angle.allFinite() || !vx.allFinite() || vx.minCoeff() <= 0.0) {
      throw InputError({inputs->name, 0, 0},
                       "steering or speed is missing or not positive in some row",
                       "both in every row", "select rows with --range");
    }
    driven = drive_inputs(vehicle.curve, vehicle.value, inputs->time, angle, vx);
  } else {
    driven =
        drive_manoeuvre(request, vehicle.curve, vehicle.value, car_model.steering_at_road_wheel);
  }
  const Index N = driven.time.size();
  std::vector<OutputColumn> columns{time_column(model, driven.time)};
  columns.push_back({column_name(model.inputs[0]), model.inputs[0].unit, driven.steering});
  columns.push_back({column_name(model.inputs[1]), model.inputs[1].unit, driven.vx});
  const std::size_t first = columns.size();
  std::vector<double> sd = car_model.measurement_sd;
  for (std::size_t i = 0; i < model.outputs.size(); ++i) {
    const ChannelSource& source = model.outputs[i];
    VehicleSensor sensor;
    sensor.quantity = *vehicle_quantity(source.name);
    const auto position = car_model.sensors.find(source.name);
    if (position != car_model.sensors.end()) {
      sensor.x = position->second.x;
      sensor.y = position->second.y;
      sensor.angle = position->second.angle;
    }
    const VectorXd clean = shown_by(sensor, car_with(vehicle.curve, vehicle.value), driven);
    if (snr) {
      sd[i] = std::pow(10.0, -*snr / 20.0) * clean.norm() / std::sqrt(static_cast<double>(N));
      driven.notes.push_back(fmt::format("noise: {} {:g} dB, sd {:.6g} {}", source.name, *snr,
                                         sd[i] / unit_scale(source.unit), source.unit));
    } else if (std::isnan(sd[i])) {
      throw InputError(source.at,
                       fmt::format("no measurement noise is given for output '{}'", source.name),
                       "noise: {measurement: {kind: per-sample, sd: {" + source.name + ": ...}}}",
                       "or --snr 30dB on the command line");
    }
    columns.push_back({column_name(source), source.unit, clean});
  }
  Random random(seed);
  for (Index t = 0; t < N; ++t) {
    for (std::size_t i = 0; i < sd.size(); ++i) {
      columns[first + i].values[t] += sd[i] * random.normal();
    }
  }
  return {csv_text(model, seed, driven.notes, driven.time, columns), N, driven.notes};
}

}  // namespace identikal
