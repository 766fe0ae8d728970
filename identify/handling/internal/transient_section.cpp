#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <functional>
#include <numbers>

#include <fmt/format.h>

#include "identify/handling/internal/carried_errors.h"
#include "identify/handling/internal/log_response.h"
#include "identify/handling/internal/sections.h"
#include "identify/handling/internal/step_figures.h"
#include "lib/base/constants.h"
#include "lib/base/quantile.h"
#include "lib/vehicle/frequency_response.h"
#include "lib/vehicle/steady_turn.h"
#include "lib/vehicle/steering_response.h"

namespace identikal {
namespace {

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::VectorXd;
using Value = HandlingSheet::Value;
using Section = HandlingSheet::Section;

constexpr double kTurn = 2.0 * std::numbers::pi;
constexpr const char* kNoSegment =
    "The log has no segment of ten seconds, without gaps, at one speed.";
constexpr double kReference = 0.2;  // [Hz]: gains are related to the one there
constexpr double kFastest = 10.0;   // [Hz]: how far a bandwidth is looked for

/// 0.1 Hz is there for the power of the steering alone.
VectorXd frequencies() {
  VectorXd out(20);
  for (Index i = 0; i < 10; ++i) out[i] = 0.1 * static_cast<double>(i + 1);
  for (Index i = 0; i < 10; ++i) out[10 + i] = 1.0 + 0.2 * static_cast<double>(i + 1);
  return out;
}

/// An output as the sheet has it.
struct Output {
  const char* name;
  const char* unit;
  const char* none;  // the log has no such signal
  VectorXd DriveSignals::*signal;
  double per_si;  // of the gain
  std::function<Complex(const FrequencyResponse& response, double vx)> of;
};

/// Where the lateral acceleration is felt: at the log's sensor, else in the centre of gravity.
VehicleSensor sensor_of_ay(const std::optional<HandlingLog>& log) {
  const Index j = log ? log->run.find(VehicleQuantity::ay) : -1;
  return j >= 0 ? log->run.outputs[j].sensor : VehicleSensor{.quantity = VehicleQuantity::ay};
}

std::array<Output, 3> outputs(const VehicleSensor& ay) {
  return {Output{"r", "1/s", "The log has no yaw rate.", &DriveSignals::r, 1.0,
                 [](const FrequencyResponse& H, double) { return H.r; }},
          Output{"ay", "m/s^2/deg", "The log has no lateral acceleration.", &DriveSignals::ay,
                 1.0 / kDegreesPerRadian,
                 [ay](const FrequencyResponse& H, double) {
                   return std::cos(ay.angle) * (H.ay + ay.x * H.yaw_acceleration) +
                          std::sin(ay.angle) * ay.y * H.yaw_acceleration;
                 }},
          Output{"beta", "-", "The log has neither vy nor beta.", &DriveSignals::beta, 1.0,
                 [](const FrequencyResponse& H, double vx) { return H.vy / vx; }}};
}

double nearest_turn(double phase, double to) {
  return phase - 360.0 * std::round((phase - to) / 360.0);
}

/// Gain and phase of the model at every frequency.
void add_model_response(const KnownVehicle& car, double speed, const Output& output,
                        HandlingSheet::Response& out) {
  const auto n = static_cast<Index>(out.points.size());
  VectorXd reference(n);
  const auto at = [&](const SingleTrack<>& c, Index i) {
    return output.of(frequency_response(c, speed, kTurn * out.points[i].frequency), speed);
  };
  const SingleTrack<> here = linear_car(car.p);
  for (Index i = 0; i < n; ++i) {
    const double phase = kDegreesPerRadian * std::arg(at(here, i));
    reference[i] = i > 0 ? nearest_turn(phase, reference[i - 1]) : phase;
  }
  const std::vector<Value> values =
      with_carried_errors(car, [&](const VehicleParameters<double>& p) {
        const SingleTrack<> c = linear_car(p);
        VectorXd figures(2 * n);
        for (Index i = 0; i < n; ++i) {
          const Complex H = at(c, i);
          figures[2 * i] = output.per_si * std::abs(H);
          figures[2 * i + 1] = nearest_turn(kDegreesPerRadian * std::arg(H), reference[i]);
        }
        return figures;
      });
  for (Index i = 0; i < n; ++i) {
    out.points[i].gain_model = values[2 * i];
    out.points[i].phase_model = values[2 * i + 1];
  }
}

std::string why_blank(const TransferFunction& H) {
  if (!std::isfinite(H.relative_se)) return "The log is too short for this frequency.";
  if (H.coherence < kLeastCoherence) return "The coherence is below 0.9.";
  if (H.relative_se > kLargestError) return "The standard error of the gain is above 10 %.";
  return "The steering hardly moves at this frequency.";
}

/// Gain and phase of the log where it is excited.
void add_log_response(const std::optional<HandlingLog>& log, const Output& output,
                      const VectorXd& all, HandlingSheet::Response& out) {
  const auto leave_blank = [&](const std::string& why) {
    for (auto& point : out.points) point.gain_log = point.phase_log = blank(why);
  };
  if (!log) return leave_blank(kNoLog);
  const VectorXd& signal = log->signals.*output.signal;
  if (signal.array().isNaN().all()) return leave_blank(output.none);
  const std::vector<TransferFunction> found =
      log_response(log->signals, log->segments, signal, all);
  if (found.empty()) return leave_blank(kNoSegment);
  const std::vector<bool> excited = is_excited(found, all);
  for (std::size_t i = 0; i < out.points.size(); ++i) {
    HandlingSheet::ResponsePoint& point = out.points[i];
    const TransferFunction& H = found[i + 1];
    point.coherence = H.coherence;
    if (!excited[i + 1]) {
      point.gain_log = point.phase_log = blank(why_blank(H));
      continue;
    }
    const double gain = output.per_si * std::abs(H.value);
    point.gain_log = of_log(gain, gain * H.relative_se, H.freedom);
    const double phase =
        nearest_turn(kDegreesPerRadian * std::arg(H.value), point.phase_model.value);
    point.phase_log = of_log(phase, kDegreesPerRadian * H.relative_se, H.freedom);
  }
}

double yaw_gain_at(const SingleTrack<>& car, double speed, double frequency) {
  return std::abs(frequency_response(car, speed, kTurn * frequency).r);
}

/// Where the gain of r has fallen to 1/sqrt(2) of that at the reference, and the largest gain over
/// it; NaN where it does not fall up to kFastest.
Eigen::Vector2d bandwidth_and_peak(const SingleTrack<>& car, double speed) {
  const double reference = yaw_gain_at(car, speed, kReference);
  const double fallen = reference / std::numbers::sqrt2;
  double peak = 1.0, low = kReference, high = kReference;
  for (; high < kFastest; high += 0.02) {
    const double gain = yaw_gain_at(car, speed, high);
    peak = std::max(peak, gain / reference);
    if (gain < fallen) break;
    low = high;
  }
  if (high >= kFastest) return {kNone, peak};
  for (int i = 0; i < 50; ++i) {
    const double middle = 0.5 * (low + high);
    (yaw_gain_at(car, speed, middle) > fallen ? low : high) = middle;
  }
  return {0.5 * (low + high), peak};
}

/// The same of the log's stated frequencies.
struct LogBand {
  Value bandwidth, peak;
};
LogBand band_of(const HandlingSheet::Response& r) {
  using Point = HandlingSheet::ResponsePoint;
  const Point& reference = r.points.front();
  if (!std::isfinite(reference.gain_log.value)) {
    const Value none = blank("The log does not determine the gain at 0.2 Hz, which it relates to.");
    return {none, none};
  }
  LogBand out{blank("The gain does not fall that far at the frequencies that the log determines."),
              {}};
  const auto relative_se = [](const Point& p) { return p.gain_log.se / p.gain_log.value; };
  const double of_reference = relative_se(reference);
  const Point* highest = &reference;
  const double fallen = reference.gain_log.value / std::numbers::sqrt2;
  for (std::size_t i = 1; i < r.points.size(); ++i) {
    const Point &before = r.points[i - 1], &here = r.points[i];
    if (!std::isfinite(here.gain_log.value)) break;
    if (here.gain_log.value > highest->gain_log.value) highest = &here;
    if (here.gain_log.value > fallen || std::isfinite(out.bandwidth.value)) continue;
    const double slope =
        (here.gain_log.value - before.gain_log.value) / (here.frequency - before.frequency);
    const double at = before.frequency + (fallen - before.gain_log.value) / slope;
    const double se = fallen * std::hypot(relative_se(here), of_reference) / std::abs(slope);
    out.bandwidth = of_log(at, se);
  }
  const double peak = highest->gain_log.value / reference.gain_log.value;
  const double se =
      highest == &reference ? of_reference : peak * std::hypot(relative_se(*highest), of_reference);
  out.peak = of_log(peak, se);
  return out;
}

void add_response_figures(const KnownVehicle& car, const HandlingSheet& sheet, bool has_log,
                          Section& out) {
  const double u = sheet.speed;
  const std::vector<Value> model =
      with_carried_errors(car, [&](const VehicleParameters<double>& p) {
        const SingleTrack<> c = linear_car(p);
        const SteeringResponse<double> H = steering_response(c, u);
        const Eigen::Vector2d band = bandwidth_and_peak(c, u);
        VectorXd figures(5);
        figures << c.steering_gain / c.steering_ratio * H.yaw_gain, H.natural_frequency / kTurn,
            H.damping, band[0], band[1];
        return figures;
      });
  const LogBand log = band_of(sheet.responses.front());
  const Value by_a_fit =
      blank(has_log ? "A log gives it only through a model that is fitted to it." : kNoLog);
  const Value no_zero = blank(
      has_log ? "It is the limit at 0 Hz; the table of the response begins at 0.2 Hz." : kNoLog);
  out.figures.push_back({"steady yaw gain", "1/s", no_zero, model[0]});
  out.figures.push_back({"bandwidth of r", "Hz", log.bandwidth, model[3]});
  out.figures.push_back({"peak ratio of r", "", log.peak, model[4]});
  out.figures.push_back({"natural frequency", "Hz", by_a_fit, model[1]});
  out.figures.push_back({"damping", "", by_a_fit, model[2]});
}

/// In the order of the sheet, SI.
std::array<Value, 6> in_order(const StepFigures& f) {
  return {f.ay, f.response_of_r, f.response_of_ay, f.peak_of_r, f.overshoot, f.tb};
}
struct StepFigure {
  const char* name;
  const char* unit;
  double per_si;
};
constexpr std::array<StepFigure, 6> kStepFigures{{{"step: ay reached", "m/s^2", 1.0},
                                                  {"step: response time of r", "s", 1.0},
                                                  {"step: response time of ay", "s", 1.0},
                                                  {"step: peak response time of r", "s", 1.0},
                                                  {"step: overshoot of r", "%", 100.0},
                                                  {"step: TB", "deg s", kDegreesPerRadian}}};

VectorXd values_of(const StepFigures& figures) {
  VectorXd out(6);
  const std::array<Value, 6> each = in_order(figures);
  for (Index i = 0; i < 6; ++i) out[i] = each[i].value;
  return out;
}

/// The model's own step, where the log has none.
double step_acceleration(const KnownVehicle& car) {
  return std::min(4.0, 0.5 * largest_steady_acceleration(car_with(car.curve, car.p)));
}

void add_step_figures(const KnownVehicle& car, const std::optional<HandlingLog>& log, double speed,
                      Section& out) {
  const bool has_r = log && log->run.find(VehicleQuantity::r) >= 0;
  const std::vector<SteeringStep> steps =
      has_r ? steps_in(log->signals) : std::vector<SteeringStep>();
  std::string why =
      log ? "The log holds no step of steering that is held before and after." : kNoLog;
  if (log && !has_r) why = "The log has no yaw rate.";
  const double ay = step_acceleration(car);
  std::vector<VehicleRun::Segment> windows;
  for (const SteeringStep& step : steps) windows.push_back({step.first, step.rows});
  const VehicleRun run =
      steps.empty() ? step_run(car.curve, car.p, speed, ay) : around(log->run, windows);
  const FiguresOfCar of_model = [&](const VehicleParameters<double>& p) {
    if (!steps.empty()) return values_of(step_figures(simulated_signals(run, car.curve, p), steps));
    // The same lateral acceleration, whatever the car.
    const VehicleRun own = step_run(car.curve, p, speed, ay);
    const DriveSignals signals = simulated_signals(own, car.curve, p);
    return values_of(step_figures(signals, steps_in(signals)));
  };
  std::vector<Value> model = with_carried_errors(car, of_model);
  const StepFigures measured = steps.empty() ? StepFigures{} : step_figures(log->signals, steps);
  const std::array<Value, 6> from_log = in_order(measured);
  for (std::size_t i = 0; i < kStepFigures.size(); ++i) {
    const auto& [name, unit, per_si] = kStepFigures[i];
    Value side = steps.empty() ? blank(why) : from_log[i];
    if (std::isfinite(side.value)) side = of_log(side.value, side.se);
    if (!std::isfinite(model[i].value)) model[i] = blank("The simulation has no such figure.");
    out.figures.push_back({name, unit, in_units(side, per_si), in_units(model[i], per_si)});
  }
  if (steps.empty()) {
    out.remarks.push_back(fmt::format(
        "The model's step is one of 0.2 s at {:.3g} km/h to {:.2g} m/s^2.", 3.6 * speed, ay));
  } else {
    out.remarks.push_back(fmt::format(
        "Figures of {} at {:.3g} km/h are those of the log, and of its simulation by the model.",
        steps.size() == 1 ? std::string("the step") : fmt::format("{} steps", steps.size()),
        3.6 * steps.front().vx));
  }
}

void remark_on_segments(const HandlingLog& log, double speed, Section& out) {
  constexpr double kOneSpeed = 1.2;
  std::vector<double> speeds;
  for (const VehicleRun::Segment& s : log.segments.segments) {
    const double* vx = log.run.vx.data() + s.first;
    speeds.insert(speeds.end(), vx, vx + s.rows);
  }
  if (speeds.empty()) return;
  const double low = quantile(speeds, 0.05), high = quantile(speeds, 0.95);
  std::string text = fmt::format("The log's frequency response is that of {:.0f} s at {:.3g} km/h",
                                 static_cast<double>(speeds.size()) * log.run.step, 3.6 * speed);
  if (high > kOneSpeed * low) {
    text += fmt::format(", a mean over speeds from {:.3g} to {:.3g} km/h", 3.6 * low, 3.6 * high);
  }
  out.remarks.push_back(text + ".");
}

}  // namespace

void add_transient_section(const KnownVehicle& car, const std::optional<HandlingLog>& log,
                           HandlingSheet& sheet) {
  const VectorXd all = frequencies();
  for (const Output& output : outputs(sensor_of_ay(log))) {
    HandlingSheet::Response response{output.name, output.unit, {}};
    for (Index i = 1; i < all.size(); ++i) {
      HandlingSheet::ResponsePoint point;
      point.frequency = all[i];
      response.points.push_back(point);
    }
    add_model_response(car, sheet.speed, output, response);
    add_log_response(log, output, all, response);
    sheet.responses.push_back(std::move(response));
  }
  Section out{"ISO 7401", "transient response to steering", {}, {}};
  add_response_figures(car, sheet, log.has_value(), out);
  add_step_figures(car, log, sheet.speed, out);
  if (log) remark_on_segments(*log, sheet.speed, out);
  sheet.sections.push_back(std::move(out));
}

}  // namespace identikal
