#include "identify/survey/signals.h"

#include <algorithm>
#include <stdexcept>
#include <variant>

#include <fmt/format.h>

#include "lib/base/constants.h"

namespace identikal {

using Eigen::Index;
using Eigen::VectorXd;

std::string to_string(SignalKind kind) {
  switch (kind) {
    case SignalKind::steering:
      return "steering";
    case SignalKind::vx:
      return "vx";
    case SignalKind::wheel_speed:
      return "wheel_speed";
    case SignalKind::r:
      return "r";
    case SignalKind::vy:
      return "vy";
    case SignalKind::ay:
      return "ay";
    case SignalKind::beta:
      return "beta";
    case SignalKind::ax:
      return "ax";
  }
  return "";
}

std::string si_unit(SignalKind kind) {
  switch (kind) {
    case SignalKind::steering:
    case SignalKind::beta:
      return "rad";
    case SignalKind::vx:
    case SignalKind::wheel_speed:
    case SignalKind::vy:
      return "m/s";
    case SignalKind::r:
      return "rad/s";
    case SignalKind::ay:
    case SignalKind::ax:
      return "m/s^2";
  }
  return "";
}

namespace {

/// Wheelbase times steering ratio; NaN where the model file has no such parameters.
double length_of(const Model& model) {
  double a = kNone, b = kNone, ratio = 1.0;
  for (const Parameter& p : model.parameters) {
    if (p.name == "a") a = p.scalar();
    if (p.name == "b") b = p.scalar();
    if (p.name == "steering_ratio") ratio = p.scalar();
  }
  return ratio * (a + b);
}

}  // namespace

VehicleSignals vehicle_signals(const Model& model, const Dataset& data) {
  VehicleSignals out;
  if (std::holds_alternative<VehicleModel>(model.form)) out.length = length_of(model);
  out.name = data.name;
  out.time_column = model.time.column;
  out.time_unit = model.time.unit;
  out.restarts = model.time.restarts;
  const auto take = [&](const std::vector<ChannelSource>& sources,
                        const std::vector<Channel>& channels, const Eigen::MatrixXd& values) {
    if (sources.size() != channels.size() || values.rows() != static_cast<Index>(channels.size()) ||
        values.cols() != data.time.size()) {
      throw std::invalid_argument(fmt::format(
          "the model has {} channels, the recording {} x {} values, {} names and {} "
          "times of them",
          sources.size(), values.rows(), values.cols(), channels.size(), data.time.size()));
    }
    for (std::size_t i = 0; i < sources.size(); ++i) {
      VehicleSignal s;
      const std::string& name = sources[i].name;
      const std::optional<SignalKind> kind = signal_kind(name);
      if (!kind) continue;
      s.kind = *kind;
      s.at_wheel = name != "road_wheel_angle";
      s.column = sources[i].column.empty() ? name : sources[i].column;
      s.unit = channels[i].unit;
      s.source = data.name;
      s.scale = sources[i].scale;
      s.offset = sources[i].offset;
      s.delay = sources[i].delay;
      s.time = data.time;
      s.value = values.row(static_cast<Index>(i)).transpose();
      out.signals.push_back(std::move(s));
    }
  };
  take(model.inputs, data.inputs, data.u);
  take(model.outputs, data.outputs, data.y);
  return out;
}

VehicleSignals vehicle_signals(const Model& model, const std::vector<Dataset>& runs) {
  VehicleSignals out;
  for (const Dataset& run : runs) {
    VehicleSignals next = vehicle_signals(model, run);
    if (out.signals.empty()) {
      out = std::move(next);
      continue;
    }
    for (std::size_t i = 0; i < out.signals.size(); ++i) {
      VectorXd& time = out.signals[i].time;
      VectorXd& value = out.signals[i].value;
      const VehicleSignal& more = next.signals[i];
      const Index n = time.size();
      const double begin = time[n - 1] + std::max(20.0 * run.dt, 6.0);
      time.conservativeResize(n + more.time.size());
      value.conservativeResize(n + more.value.size());
      time.tail(more.time.size()) = more.time.array() - more.time[0] + begin;
      value.tail(more.value.size()) = more.value;
    }
  }
  return out;
}

std::optional<SignalKind> signal_kind(std::string_view name) {
  if (name == "steering_wheel_angle" || name == "road_wheel_angle") return SignalKind::steering;
  for (const SignalKind kind : {SignalKind::vx, SignalKind::r, SignalKind::vy, SignalKind::ay,
                                SignalKind::beta, SignalKind::ax}) {
    if (name == to_string(kind)) return kind;
  }
  return std::nullopt;
}

VehicleSignals within(const VehicleSignals& signals, const TimeRange& range) {
  double begin = kInfinity;
  for (const VehicleSignal& s : signals.signals) {
    if (s.time.size() > 0) begin = std::min(begin, s.time[0]);
  }
  VehicleSignals out = signals;
  for (VehicleSignal& s : out.signals) {
    const auto first = std::lower_bound(s.time.begin(), s.time.end(), begin + range.from);
    const auto last = std::upper_bound(first, s.time.end(), begin + range.to);
    const Index at = first - s.time.begin(), count = last - first;
    s.time = VectorXd(s.time.segment(at, count));
    s.value = VectorXd(s.value.segment(at, count));
  }
  return out;
}

}  // namespace identikal
