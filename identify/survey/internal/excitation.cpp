#include "identify/survey/internal/excitation.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>

#include <fmt/format.h>

#include "lib/base/constants.h"
#include "lib/base/quantile.h"
#include "lib/statistics/spectrum.h"
#include "lib/vehicle/yaw_change.h"

namespace identikal::surveying {

using Eigen::Index;
using Eigen::VectorXd;
namespace {

constexpr double kTurning = 0.05;  // [rad/s]
constexpr double kHalfSecond = 0.5;
// [1/s]: what a yaw rate changes by within an eighth of a second, over that time. ISO 7401 steps held
// for five seconds have 1.1 to 1.4 and leave Iz with errors of 10 to 20 %, town and country driving
// below 1 with 20 to 40 %.
constexpr double kQuick = 1.04, kEighth = 0.125;
// Of |ay|, 95 % quantile [m/s^2]: below the first no tyre shows anything, above the second all do.
constexpr double kUnloaded = 0.3, kWellLoaded = 1.0;

// Speeds, lateral accelerations and sides of the drive.
void measure_turning(Scene& scene) {
  VehicleSurvey& out = scene.out;
  const VectorXd r = while_driving(scene, scene.smooth[SignalKind::r], kSlowestTest);
  const VectorXd& v = scene.speed;
  const bool measured_ay = scene.has(SignalKind::ay) && !scene.found(FindingCode::units_ay) &&
                           !scene.found(FindingCode::swapped_channels);
  const VectorXd ay = measured_ay ? scene.smooth[SignalKind::ay] : VectorXd(v.cwiseProduct(r));
  constexpr double kEdges[] = {1, 2, 3, 4, 6, 8};
  double count = 0, turning = 0, left = 0, steady = 0, fast = 0;
  std::vector<double> speeds;
  const bool steered = scene.has(SignalKind::steering);
  const VectorXd steering = steered ? scene.smooth[SignalKind::steering] : VectorXd();
  const auto ahead = std::max<Index>(1, std::lround(0.5 / scene.step));
  const double spread = steered ? quantile_of(steering, 0.95) - quantile_of(steering, 0.05) : kNaN;
  const double turn = std::min(kTurning, 0.3 * quantile_of(VectorXd(r.cwiseAbs()), 0.95));
  for (Index i = 0; i < r.size(); ++i) {
    if (std::isnan(r[i]) || std::isnan(v[i])) continue;
    if (!std::isnan(ay[i])) {
      std::size_t bin = 0;
      while (bin < std::size(kEdges) && std::abs(ay[i]) > kEdges[bin]) ++bin;
      ++out.lateral_acceleration[bin];
      ++count;
    }
    if (std::abs(r[i]) <= turn) continue;
    ++turning;
    left += r[i] > 0.0 ? 1 : 0;
    speeds.push_back(v[i]);
    if (!steered || i + ahead >= r.size()) continue;
    const double change = std::abs(steering[i + ahead] - steering[i]);
    if (std::isnan(change)) continue;
    ++fast;
    steady += change < 0.03 * spread ? 1 : 0;
  }
  for (double& share : out.lateral_acceleration) share = count > 0 ? share / count : 0.0;
  out.left = turning > 0 ? left / turning : kNaN;
  out.steady = fast > 0 ? steady / fast : kNaN;
  for (std::size_t k = 0; k < out.speed.size(); ++k) {
    constexpr double kAt[] = {0.0, 0.05, 0.5, 0.95, 1.0};
    out.speed[k] = quantile(speeds, kAt[k]);
  }
}

// How fast the steering moves.
void measure_frequencies(Scene& scene) {
  if (!scene.has(SignalKind::steering)) return;
  const VectorXd moving = while_driving(scene, scene.on[SignalKind::steering], kSlowestTest);
  const Index n = moving.size() - (moving.size() > 512 ? moving.size() % 256 : 0);
  const std::vector<double> known = present(moving.head(n));
  if (n < 64 || known.size() < 64 || quantile(known, 0.0) == quantile(known, 1.0)) return;
  const Spectrum spectrum = multitaper(moving.head(n).transpose(), 3);
  double all = 0.0, half_hertz = 0.0, more = 0.0;
  for (Index k = 0; k < spectrum.omega.size(); ++k) {
    const double power = spectrum.S[k](0, 0).real();
    const double hertz = spectrum.omega[k] / (2.0 * std::numbers::pi * scene.step);
    all += power;
    half_hertz += hertz > 0.5 ? power : 0.0;
    more += hertz > 1.5 ? power : 0.0;
  }
  scene.out.steering_above_0_5_hz = half_hertz / all;
  scene.out.steering_above_1_5_hz = more / all;
}

}  // namespace

void measure_excitation(Scene& scene) {
  measure_turning(scene);
  measure_frequencies(scene);
  const VectorXd r = while_driving(scene, scene.on[SignalKind::r], kSlowestTest);
  scene.out.yaw_change = yaw_change(scene.time, r, kHalfSecond);
}

void measure_straight_running(Scene& scene) {
  if (!scene.has(SignalKind::r)) return;
  const VectorXd r = while_driving(scene, scene.smooth[SignalKind::r], 5.0);
  std::vector<bool> straight(static_cast<std::size_t>(r.size()), false);
  double total = 0.0;
  for (Index i = 0, end = 0; i < r.size(); i = end) {
    end = i + 1;
    if (!(std::abs(r[i]) < 0.02)) continue;
    while (end < r.size() && std::abs(r[end]) < 0.02) ++end;
    if (scene.time[end - 1] - scene.time[i] < 1.0) continue;
    total += scene.time[end - 1] - scene.time[i];
    for (Index k = i; k < end; ++k) straight[k] = true;
  }
  if (total < 2.0) return;
  for (VehicleSurvey::Signal& entry : scene.out.signals) {
    for (const SignalKind kind : {SignalKind::steering, SignalKind::r, SignalKind::ay}) {
      if (!scene.has(kind) || scene.signal(kind).column != entry.column) continue;
      std::vector<double> values;
      for (Index i = 0; i < r.size(); ++i) {
        const double x = scene.on[kind][i];
        if (straight[i] && !std::isnan(x)) values.push_back(x);
      }
      entry.straight = quantile(std::move(values), 0.5) / unit_scale(scene.signal(kind));
    }
  }
}

namespace {

/// What the verdicts depend on.
struct Excitation {
  bool sideslip = false;     ///< measured
  bool at_wheel = false;     ///< the angle is that of the steering wheel
  double speed_ratio = 0.0;  ///< 95 % over 5 % quantile while turning
  double strong = 0.0;       ///< share of |ay| above 2 m/s^2
  bool loaded = false;       ///< the tyres
  bool well_loaded = false;
  double load = kNaN;         ///< 95 % quantile of vx |r| [m/s^2]
  bool acceleration = false;  ///< measured
  bool quick = false;         ///< steering and yaw rate change before the yaw motion settles
  bool clocks = false;        ///< they are apart: a delay acts as an inertia does
  bool circles = false;       ///< steady-state cornering
  bool very_quick = false;    ///< so does the steering
  std::string changes, frequencies, speeds;

  bool several_speeds() const { return speed_ratio > 2.0; }
  // Strong steady-state cornering at several speeds separates steering gain and understeer.
  bool gain_determined() const { return several_speeds() && strong > 0.05; }
  bool gain_weak() const { return speed_ratio > 1.5 && strong > 0.05; }
  const char* ratio() const { return at_wheel ? "steering ratio" : "steering gain"; }
};

Excitation excitation_of(const Scene& scene) {
  const VehicleSurvey& survey = scene.out;
  Excitation out;
  out.sideslip = scene.has(SignalKind::vy) || scene.has(SignalKind::beta);
  out.at_wheel = scene.has(SignalKind::steering) && scene.signal(SignalKind::steering).at_wheel;
  out.speed_ratio = survey.speed[3] / survey.speed[1];
  out.strong = survey.lateral_acceleration[2] + survey.lateral_acceleration[3] +
               survey.lateral_acceleration[4] + survey.lateral_acceleration[5] +
               survey.lateral_acceleration[6];
  const VectorXd turning = scene.speed.cwiseProduct(scene.smooth.at(SignalKind::r)).cwiseAbs();
  out.load = quantile_of(while_driving(scene, turning, kSlowestTest), 0.95);
  out.loaded = out.load > kUnloaded;
  out.well_loaded = out.load > kWellLoaded;
  out.acceleration = scene.has(SignalKind::ay);
  // As fit asks: small corrections of the lane and the steps of a sensor are no excitation.
  const VectorXd r = while_driving(scene, scene.on.at(SignalKind::r), kSlowestTest);
  const double block = std::max(kEighth, 4.0 * scene.step);
  const auto is_quick = [&](const VectorXd& x) {
    return yaw_change(scene.time, x, block) > kQuick * block;
  };
  out.quick = !std::isnan(survey.yaw_change) && is_quick(r) &&
              is_quick(while_driving(scene, scene.on.at(SignalKind::steering), kSlowestTest));
  out.clocks = scene.found(FindingCode::clock_offset);
  out.circles = turns_steadily(scene.time, r);
  out.very_quick = survey.steering_above_1_5_hz > 0.02 && !out.circles;
  out.changes = std::isnan(survey.yaw_change)
                    ? "the yaw rate is too short a series to tell how quickly it changes"
                    : fmt::format("within {:g} s the yaw rate changes by {:.3g} % of its size",
                                  kHalfSecond, 100.0 * survey.yaw_change);
  out.frequencies =
      std::isnan(survey.steering_above_0_5_hz)
          ? "too few samples for a spectrum of the steering angle"
          : fmt::format("{:.2g} % of the steering's power lies above 0.5 Hz, {:.2g} % above 1.5 Hz",
                        100.0 * survey.steering_above_0_5_hz, 100.0 * survey.steering_above_1_5_hz);
  out.speeds = std::isnan(survey.speed[1])
                   ? "the car never turns"
                   : fmt::format("turning at {:.0f} to {:.0f} m/s (5 to 95 %)", survey.speed[1],
                                 survey.speed[3]);
  return out;
}

using Verdicts = std::vector<VehicleSurvey::Verdict>;

VehicleSurvey::Verdict inertia_stays_open(const Excitation& seen) {
  return {"Iz", "no", "yaw inertia acts only while the yaw rate changes; " + seen.changes};
}

void assess_stiffness_and_inertia(const Excitation& seen, Verdicts& out) {
  if (!seen.loaded) {
    const std::string why =
        std::isnan(seen.load)
            ? std::string("there is no yaw rate to tell how the tyres are loaded")
            : fmt::format(
                  "the tyres are hardly loaded: |ay| stays below {:.2g} m/s^2 95 % of the time",
                  seen.load);
    out.push_back({"Cf, Cr", "no", why});
    out.push_back({"Iz", "no", why});
  } else if (seen.sideslip) {
    out.push_back({"Cf, Cr", seen.well_loaded ? "yes" : "poorly",
                   fmt::format("over mass, given the {}: sideslip separates front and rear{}",
                               seen.ratio(), seen.circles ? ", in steady circles too" : "")});
    if (seen.circles) {
      out.push_back(inertia_stays_open(seen));
    } else {
      const bool told = seen.quick && seen.well_loaded && !seen.clocks;
      out.push_back(
          {"Iz", told ? "yes" : "poorly",
           seen.changes + (seen.clocks ? "; what the clocks are apart acts as an inertia" : "")});
    }
  } else if (seen.circles) {
    out.push_back({"Cf, Cr", "combination",
                   "steady-state circles determine only the products i L and i K, K = "
                   "m (b Cr - a Cf)/(L Cf Cr)"});
    out.push_back(inertia_stays_open(seen));
  } else if (seen.acceleration && seen.quick) {
    out.push_back({"Cf, Cr", "poorly",
                   fmt::format("ay in place of sideslip: only with the {} exact and without a lag "
                               "or a body that leans; {}",
                               seen.ratio(), seen.changes)});
    out.push_back({"Iz", "poorly", "with Cf and Cr only; " + seen.changes});
  } else if (seen.very_quick) {
    out.push_back({"Cf, Cr", "poorly",
                   fmt::format("yaw rate without sideslip: only with m, a, b and the {} exact; {}",
                               seen.ratio(), seen.frequencies)});
    out.push_back({"Iz", "poorly", "with Cf and Cr only: yaw rate without sideslip"});
  } else {
    out.push_back({"Cf, Cr", "combination",
                   fmt::format("yaw rate without sideslip and {}: the understeer gradient, no more",
                               seen.frequencies)});
    out.push_back(
        {"Iz", "no", seen.frequencies + "; without sideslip some above 1.5 Hz is needed"});
  }
}

void assess_steering_gain(const Excitation& seen, Verdicts& out) {
  const char* which = seen.at_wheel ? "steering_ratio" : "steering_gain";
  if (seen.gain_determined()) {
    out.push_back(
        {which, seen.circles ? "combination" : "yes",
         seen.speeds + (seen.circles ? ": times the wheelbase" : ", with some strength")});
  } else if (seen.gain_weak()) {
    out.push_back({which, "poorly", seen.speeds + ": a ratio above 2 determines it better"});
  } else {
    out.push_back({which, "no",
                   seen.speeds +
                       (seen.several_speeds()
                            ? fmt::format(", but only {} of it above 2 m/s^2", percent(seen.strong))
                            : ": a ratio above 2, or a slow segment, is needed") +
                       "; with a wrong one wrong stiffnesses fit as well"});
  }
}

void assess_lengths_and_offsets(const Excitation& seen, double left, Verdicts& out) {
  out.push_back({"a, b", seen.sideslip ? "poorly" : "no",
                 seen.sideslip ? "needs sideslip at several speeds; axle weights are better"
                               : "needs sideslip, or axle weights"});
  const double lesser = std::min(left, 1.0 - left);
  out.push_back(
      {"offsets", lesser > 0.2 || seen.several_speeds() ? "yes" : "no",
       std::isnan(left)
           ? std::string("steering offset, yaw bias, ay bias: the car never turns")
           : fmt::format("steering offset, yaw bias, ay bias: {} of turning is to the left{}",
                         percent(left), seen.several_speeds() ? ", several speeds" : "")});
}

}  // namespace

void assess_identifiability(Scene& scene) {
  Verdicts& out = scene.out.identifiable;
  if (scene.found(FindingCode::too_short) || scene.found(FindingCode::no_steering) ||
      scene.found(FindingCode::no_speed) ||
      (scene.found(FindingCode::no_yaw_rate) && !scene.has(SignalKind::ay))) {
    out.push_back({"Cf, Cr", "no",
                   "steering angle, speed and yaw rate of a driven manoeuvre are not all there"});
    return;
  }
  if (scene.found(FindingCode::no_yaw_rate)) {
    out.push_back(
        {"Cf, Cr", "poorly", "no yaw rate: what the other signals determine was not examined"});
    return;
  }
  const Excitation seen = excitation_of(scene);
  assess_stiffness_and_inertia(seen, out);
  assess_steering_gain(seen, out);
  assess_lengths_and_offsets(seen, scene.out.left, out);
}

}  // namespace identikal::surveying
