#include "identify/simulate.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <stdexcept>
#include <vector>

#include <fmt/format.h>

#include "identify/vehicle_problem.h"
#include "lib/interpolation.h"
#include "lib/random.h"
#include "lib/realisation.h"
#include "lib/units.h"
#include "lib/vehicle_sensor.h"

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

// "3" stands for the third column of a file; a simulated file needs a name that says the same.
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
    const Unit unit = parse_unit(column->unit).value_or(Unit{});
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

std::string csv_text(const ModelFile& model, std::uint64_t seed,
                     const std::vector<std::string>& notes, const VectorXd& time,
                     std::vector<OutputColumn> columns) {
  record(model.inputs, time, columns);
  record(model.outputs, time, columns);
  std::string out = fmt::format("# simulated from '{}', seed {}\n", model.name, seed);
  for (const std::string& note : notes) out += "# " + note + "\n";
  for (const ReportedEntries entries = reported_entries(model.parameters);
       const std::string& name : entries.names) {
    const auto i = static_cast<std::size_t>(&name - entries.names.data());
    const Unit unit = parse_unit(entries.units[i]).value_or(Unit{});
    out += fmt::format("# truth: {} = {:.10g} {}\n", name,
                       unit.from_si(entries.value[static_cast<Index>(i)]), entries.units[i]);
  }
  for (std::size_t c = 0; c < columns.size(); ++c) {
    const std::string unit = columns[c].unit.empty() ? "" : " [" + columns[c].unit + "]";
    out += (c > 0 ? "," : "") + columns[c].name + unit;
  }
  out += "\n";
  const Index rows = columns.empty() ? 0 : columns[0].values.size();
  for (Index t = 0; t < rows; ++t) {
    for (std::size_t c = 0; c < columns.size(); ++c) {
      const Unit unit = parse_unit(columns[c].unit).value_or(Unit{});
      out += fmt::format("{}{:.10g}", c > 0 ? "," : "", unit.from_si(columns[c].values[t]));
    }
    out += "\n";
  }
  return out;
}

OutputColumn time_column(const ModelFile& model, const VectorXd& time) {
  return {model.time.column.empty() ? "time" : model.time.column,
          model.time.unit.empty() ? "s" : model.time.unit, time};
}

}  // namespace

Simulated simulate_linear(const ModelFile& model, Index rows, const Dataset* inputs,
                          std::uint64_t seed) {
  const StateSpace system = instantiate(model.linear, model.parameters);
  const Location at{model.path, 0, 0};
  if (system.inputs() > 0 && inputs == nullptr) {
    throw InputError(at, "the model has inputs", "a recording that holds them",
                     "add it to the command line");
  }
  const Index N = inputs != nullptr ? inputs->size() : rows;
  Random random(seed);
  const MatrixXd u = inputs != nullptr ? model_inputs(model.linear, inputs->u) : MatrixXd();
  MatrixXd y;
  try {
    y = realisation(system, model.linear.initial, u, N, random);
  } catch (const std::invalid_argument&) {
    throw InputError(
        at, "the model cannot be simulated",
        "[Q S; S' R] positive semidefinite, and a stable A with 'initial: stationary'");
  }
  const double step = inputs != nullptr ? inputs->dt : system.dt;
  const VectorXd time =
      inputs != nullptr ? inputs->time
                        : VectorXd(VectorXd::LinSpaced(N, 0.0, static_cast<double>(N - 1) * step));
  // Columns that the model names by number must stand where it says, so time comes last.
  std::vector<OutputColumn> columns;
  for (Index i = 0; i < y.rows(); ++i) {
    const ChannelSource& source = model.outputs[static_cast<std::size_t>(i)];
    columns.push_back({column_name(source), source.unit, y.row(i).transpose()});
  }
  for (std::size_t i = 0; i < model.inputs.size(); ++i) {
    const ChannelSource& source = model.inputs[i];
    const VectorXd values = inputs->u.row(static_cast<Index>(i)).transpose();
    columns.push_back({column_name(source), source.unit, values});
  }
  columns.push_back(time_column(model, time));
  return {csv_text(model, seed, {}, time, columns), N, {}};
}

Simulated simulate_vehicle(const ModelFile& model, const ManoeuvreRequest& request,
                           const Dataset* inputs, std::optional<double> snr, std::uint64_t seed) {
  const VehicleUnknowns vehicle = vehicle_unknowns(model);
  const SingleTrack<> car = linear_car(vehicle.value);
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
    driven = drive_manoeuvre(request, vehicle.curve, vehicle.value,
                             model.vehicle.steering_at_road_wheel);
  }
  const Index N = driven.time.size();
  std::vector<OutputColumn> columns{time_column(model, driven.time)};
  columns.push_back({column_name(model.inputs[0]), model.inputs[0].unit, driven.steering});
  columns.push_back({column_name(model.inputs[1]), model.inputs[1].unit, driven.vx});
  const std::size_t first = columns.size();
  std::vector<double> sd = model.vehicle.measurement_sd;
  for (std::size_t i = 0; i < model.outputs.size(); ++i) {
    const ChannelSource& source = model.outputs[i];
    VehicleSensor sensor;
    sensor.quantity = *vehicle_quantity(source.name);
    const auto position = model.vehicle.sensors.find(source.name);
    if (position != model.vehicle.sensors.end()) {
      sensor.x = position->second.x;
      sensor.y = position->second.y;
      sensor.angle = position->second.angle;
    }
    const VehicleReading reading(sensor, car);
    VectorXd clean(N);
    for (Index t = 0; t < N; ++t) {
      clean[t] = reading.value(driven.motion[static_cast<std::size_t>(t)], driven.vx[t]);
    }
    if (snr) {
      sd[i] = std::pow(10.0, -*snr / 20.0) * clean.norm() / std::sqrt(static_cast<double>(N));
      const double per_unit = parse_unit(source.unit).value_or(Unit{}).scale;
      driven.notes.push_back(fmt::format("noise: {} {:g} dB, sd {:.6g} {}", source.name, *snr,
                                         sd[i] / per_unit, source.unit));
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
