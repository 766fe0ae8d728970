// Which signals of a vehicle does a recording hold, in which units and signs?
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "identify/estimate/details.h"
#include "identify/model/model_file.h"
#include "lib/data/dataset.h"

namespace identikal {

/// What a signal of a vehicle measures. `steering` is an angle at the steering wheel or at the
/// road wheel, as its gain shows. `wheel_speed` is a speed [m/s] derived from turning wheels.
enum class SignalKind { steering, vx, wheel_speed, r, vy, ay, beta, ax };
std::string to_string(SignalKind kind);
/// What a signal of that kind is measured in: "rad", "m/s", "rad/s" or "m/s^2".
std::string si_unit(SignalKind kind);

/// The kind of a model file's channel: "road_wheel_angle", "vx", "r", ...
std::optional<SignalKind> signal_kind(std::string_view name);

struct VehicleSignal {
  SignalKind kind = SignalKind::r;
  std::string column;    ///< how the file, or the model, calls it
  std::string unit;      ///< the recorded one, or the guessed one
  std::string source;    ///< file that it comes from: signals of one file share a clock
  bool at_wheel = true;  ///< steering: angle of the steering wheel, not of the road wheels
  double scale = 1.0, offset = 0.0, delay = 0.0;  ///< of the model file, applied already
  double axis = 1.0;      ///< -1: the name says that its axis points right or down
  Eigen::VectorXd time;   ///< [s], increasing
  Eigen::VectorXd value;  ///< SI, NaN = missing
};

/// Of each kind the first is used; further ones are only described.
struct VehicleSignals {
  std::string name;
  std::vector<VehicleSignal> signals;
  std::string time_column, time_unit;
  bool restarts = false;  ///< several runs in one file: each begins where time goes back
  double length = kNone;  ///< wheelbase times steering ratio of the model file [m]
  Findings findings;      ///< what was found while the columns were guessed
};

/// The channels of a recording as a model file maps them.
///
/// Example:
///
///     TimeRange first_minute;
///     first_minute.to = 60.0;
///     const VehicleSignals signals = within(vehicle_signals(car, recordings), first_minute);
VehicleSignals vehicle_signals(const Model& model, const Dataset& data);

/// The same of several runs, one after the other: far enough apart that nothing is interpolated
/// across, nor compared with the run before.
VehicleSignals vehicle_signals(const Model& model, const std::vector<Dataset>& runs);

/// The samples inside the range, which counts from the earliest sample of all.
VehicleSignals within(const VehicleSignals& signals, const TimeRange& range);

}  // namespace identikal
