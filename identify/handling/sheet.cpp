#include "identify/handling/sheet.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "identify/estimate/parameter_table.h"
#include "identify/handling/internal/sections.h"
#include "identify/vehicle/checks.h"
#include "identify/vehicle/unknowns.h"
#include "lib/base/constants.h"
#include "lib/data/units.h"

namespace identikal {
namespace {

using Eigen::Index;

constexpr double kUsualSpeed = 80.0 / 3.6;  // ISO 7401

/// A standard error in SI, of what the mathematics has in place of the user's parameter.
double si_error(const EstimatedParameter& p, VehicleParameter parameter, double value) {
  return p.se * unit_or_dimensionless(p.unit).scale / in_user_terms(parameter, value).slope;
}

double mean_speed(const VehicleRun& run) {
  double sum = 0.0;
  for (const VehicleRun::Segment& s : run.segments) sum += run.vx.segment(s.first, s.rows).sum();
  return sum / static_cast<double>(run.used);
}

// As far beyond what a fit saw nothing changes (identify/vehicle/driven_range.h).
constexpr double kBelow = 0.9, kAbove = 1.1;
constexpr double kAcceleration = 0.3;  // [m/s^2]

/// Share of the rows whose speed or vx r lies outside what the fit saw of it.
double share_outside(const std::vector<DrivenRange>& driven, const DriveSignals& s) {
  const auto outside = [&](const char* quantity, double value) {
    return std::any_of(driven.begin(), driven.end(), [&](const DrivenRange& range) {
      // As good to the left as to the right.
      const double limit = std::max(std::abs(range.low), std::abs(range.high));
      const bool is_speed = range.quantity == "vx";
      return range.quantity == quantity &&
             (is_speed ? value < kBelow * range.low || value > kAbove * range.high
                       : std::abs(value) > kAbove * limit + kAcceleration);
    });
  };
  double rows = 0.0, out = 0.0;
  for (const VehicleRun::Segment& segment : s.segments) {
    for (Index t = segment.first; t < segment.first + segment.rows; ++t) {
      rows += 1.0;
      if (outside("vx", s.vx[t]) || outside("ay", s.vx[t] * s.r[t])) out += 1.0;
    }
  }
  return out / rows;
}

void remark_on_range(const KnownVehicle& car, const std::optional<HandlingLog>& log,
                     HandlingSheet& sheet) {
  constexpr double kShare = 0.02;  // one in a hundred rows of the fit lies outside
  std::vector<std::string> fitted;
  for (const DrivenRange& range : car.driven) {
    if (range.quantity == "vx" || range.quantity == "ay") fitted.push_back(in_words(range));
    if (range.quantity != "vx" ||
        !(sheet.speed < kBelow * range.low || sheet.speed > kAbove * range.high))
      continue;
    sheet.remarks.push_back(
        fmt::format("The model's response is that at {:.3g} m/s, beyond {} of its fit.",
                    sheet.speed, in_words(range)));
  }
  if (!log || fitted.empty()) return;
  const double share = share_outside(car.driven, log->signals);
  if (!(share > kShare)) return;
  sheet.remarks.push_back(fmt::format(
      "{:.0f} % of the log's rows lie outside what the model was fitted to ({}): there its figures "
      "are extrapolated.",
      100.0 * share, fmt::join(fitted, ", ")));
}

void remark_on_log(const KnownVehicle& car, const HandlingLog& log, HandlingSheet& sheet) {
  constexpr double kLinear = 4.0;  // [m/s^2]
  constexpr double kShare = 0.1;
  double rows = 0.0, beyond_linear = 0.0;
  for (const VehicleRun::Segment& s : log.run.segments) {
    for (Index t = s.first; t < s.first + s.rows; ++t) {
      rows += 1.0;
      if (std::abs(log.signals.vx[t] * log.signals.r[t]) > kLinear) beyond_linear += 1.0;
    }
  }
  if (beyond_linear > kShare * rows) {
    sheet.remarks.push_back(fmt::format(
        "{:.0f} % of the log's rows lie above 4 m/s^2, where tyres bend: the log's response is one "
        "of that size, the model's closed forms are those about straight driving.",
        100.0 * beyond_linear / rows));
  }
  const Index ay = log.run.find(VehicleQuantity::ay);
  if (ay >= 0 && (log.run.outputs[ay].sensor.x != 0.0 || log.run.outputs[ay].sensor.y != 0.0)) {
    sheet.remarks.push_back(
        "Lateral accelerations of ISO 7401 and ISO 3888 are those where the sensor sits.");
  }
  if (!car.at_bound.empty()) {
    sheet.remarks.push_back(fmt::format("{} ended at a bound in the fit and {} taken as known.",
                                        fmt::join(car.at_bound, ", "),
                                        car.at_bound.size() == 1 ? "is" : "are"));
  }
}

}  // namespace

VehicleRun around(const VehicleRun& run, const std::vector<VehicleRun::Segment>& windows) {
  constexpr double kLead = 2.0;  // [s]: by then the initial state is forgotten
  VehicleRun out = run;
  out.segments.clear();
  const auto lead = static_cast<Index>(std::lround(kLead / run.step));
  for (const VehicleRun::Segment& segment : run.segments) {
    for (const VehicleRun::Segment& window : windows) {
      if (window.first < segment.first || window.first >= segment.first + segment.rows) continue;
      const Index first = std::max(segment.first, window.first - lead);
      out.segments.push_back({first, window.first + window.rows - first});
    }
  }
  return out;
}

KnownVehicle known_vehicle(const Model& model) {
  const VehicleUnknowns unknowns = vehicle_unknowns(model);
  KnownVehicle out;
  out.p = unknowns.value;
  out.curve = unknowns.curve;
  out.covariance.resize(0, 0);
  return out;
}

KnownVehicle known_vehicle(const Model& model, const StoredEstimate& result) {
  KnownVehicle out = known_vehicle(model);
  out.estimated = true;
  out.freedom = result.covariance_freedom;
  out.driven = result.driven;
  out.derived = result.derived;
  std::vector<double> se;
  for (int i = 0; i < kVehicleParameters; ++i) {
    const auto parameter = static_cast<VehicleParameter>(i);
    const EstimatedParameter* p = reported(result, name_of(parameter));
    if (p == nullptr || p->fixed) continue;
    if (std::isfinite(p->se) && p->se > 0.0) {
      out.uncertain.push_back(parameter);
      se.push_back(si_error(*p, parameter, out.p[parameter]));
    } else if (p->verdict == Verdict::at_bound) {
      out.at_bound.push_back(p->name);
    } else {
      out.open.push_back(parameter);
    }
  }
  const auto k = static_cast<Index>(se.size());
  out.covariance.resize(k, k);
  for (Index i = 0; i < k; ++i) {
    for (Index j = 0; j < k; ++j) {
      out.covariance(i, j) =
          se[i] * se[j] *
          correlation_of(result, name_of(out.uncertain[i]), name_of(out.uncertain[j]));
    }
  }
  return out;
}

Findings check_log(const KnownVehicle& car, const Model& model,
                   const std::vector<Dataset>& recordings) {
  if (recordings.empty()) return {};
  const VehicleRun run = usable_run(model, recordings);
  Findings out = run.findings;
  append(out, check_signs(run, car.p));
  return out;
}

HandlingSheet handling_sheet(const KnownVehicle& car, const Model& model,
                             const std::vector<Dataset>& recordings,
                             const HandlingOptions& options) {
  std::optional<HandlingLog> log;
  if (!recordings.empty()) {
    log.emplace();
    log->run = usable_run(model, recordings);
    log->signals = measured_signals(log->run, car.p);
    log->segments = response_segments(log->signals, options.speed);
  }
  HandlingSheet out;
  out.steering = as_vehicle(model).steering_at_road_wheel ? "road wheel" : "steering wheel";
  out.speed = options.speed;
  if (log && std::isnan(out.speed)) {
    out.speed = std::isfinite(log->segments.speed) ? log->segments.speed : mean_speed(log->run);
  }
  if (std::isnan(out.speed)) out.speed = kUsualSpeed;
  add_steady_section(car, log, out);
  add_transient_section(car, log, out);
  add_lane_change_section(car, log, out);
  remark_on_range(car, log, out);
  if (log) remark_on_log(car, *log, out);
  return out;
}

}  // namespace identikal
