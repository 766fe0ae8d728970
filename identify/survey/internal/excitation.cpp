#include "identify/survey/internal/excitation.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>

#include <fmt/format.h>

#include "lib/base/constants.h"
#include "lib/base/quantile.h"
#include "lib/statistics/spectrum.h"

namespace identikal::surveying {

using Eigen::Index;
using Eigen::VectorXd;
namespace {

constexpr double kTurning = 0.05;  // [rad/s]

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
  bool loaded = false;       ///< the tyres, |ay| above 1 m/s^2
  // Dynamics show where the steering moves faster than the yaw motion settles.
  bool quick = false, rather_quick = false, very_quick = false;
  bool circles = false;  ///< steady-state cornering
  std::string frequencies, speeds;

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
  out.loaded = survey.lateral_acceleration[0] < 0.98;
  out.quick = survey.steering_above_0_5_hz > 0.05;
  out.rather_quick = survey.steering_above_0_5_hz > 0.005;
  out.very_quick = survey.steering_above_1_5_hz > 0.02;
  out.circles = survey.steady > 0.8 && survey.steering_above_0_5_hz < 0.05;
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

void assess_stiffness_and_inertia(const Excitation& seen, double below_1, Verdicts& out) {
  if (!seen.loaded) {
    const std::string why = fmt::format(
        "the tyres are hardly loaded: |ay| stays below 1 m/s^2 {} of the time", percent(below_1));
    out.push_back({"Cf, Cr", "no", why});
    out.push_back({"Iz", "no", why});
  } else if (seen.circles) {
    out.push_back({"Cf, Cr", "combination",
                   fmt::format("steady-state circles determine only the products i L and i K, K = "
                               "m (b Cr - a Cf)/(L Cf Cr){}",
                               seen.sideslip ? "; with sideslip the rear axle too" : "")});
    out.push_back(
        {"Iz", "no", "yaw inertia acts only while the yaw rate changes; " + seen.frequencies});
  } else if (seen.sideslip) {
    out.push_back(
        {"Cf, Cr", seen.quick || seen.gain_determined() || seen.gain_weak() ? "yes" : "poorly",
         fmt::format("over mass, given the {}: sideslip separates front and rear", seen.ratio())});
    out.push_back({"Iz",
                   seen.quick          ? "yes"
                   : seen.rather_quick ? "poorly"
                                       : "no",
                   seen.frequencies});
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
  assess_stiffness_and_inertia(seen, scene.out.lateral_acceleration[0], out);
  assess_steering_gain(seen, out);
  assess_lengths_and_offsets(seen, scene.out.left, out);
}

}  // namespace identikal::surveying
