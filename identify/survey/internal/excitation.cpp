#include "identify/survey/internal/excitation.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>

#include <fmt/format.h>

#include "lib/base/constants.h"
#include "lib/statistics/spectrum.h"

namespace identikal::surveying {

using Eigen::Index;
using Eigen::VectorXd;
namespace {

constexpr double kTurning = 0.05;  // [rad/s]

}  // namespace

void look_at_excitation(Scene& scene) {
  VehicleSurvey& out = scene.out;
  const VectorXd r = while_driving(scene, scene.smooth[SignalKind::r], kSlowestTest);
  const VectorXd& v = scene.speed;
  const bool measured_ay =
      scene.has(SignalKind::ay) && !scene.found("units_ay") && !scene.found("swapped_channels");
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
      ++out.lateral[bin];
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
  for (double& share : out.lateral) share = count > 0 ? share / count : 0.0;
  out.left = turning > 0 ? left / turning : kNaN;
  out.steady = fast > 0 ? steady / fast : kNaN;
  for (std::size_t k = 0; k < out.speed.size(); ++k) {
    constexpr double kAt[] = {0.0, 0.05, 0.5, 0.95, 1.0};
    out.speed[k] = quantile_of(speeds, kAt[k]);
  }
  if (!steered) return;
  const VectorXd moving = while_driving(scene, scene.on[SignalKind::steering], kSlowestTest);
  const Index n = moving.size() - (moving.size() > 512 ? moving.size() % 256 : 0);
  const std::vector<double> known = present(moving.head(n));
  if (n < 64 || known.size() < 64 || quantile_of(known, 0.0) == quantile_of(known, 1.0)) return;
  const Spectrum spectrum = multitaper(moving.head(n).transpose(), 3);
  double all = 0.0, half_hertz = 0.0, more = 0.0;
  for (Index k = 0; k < spectrum.omega.size(); ++k) {
    const double power = spectrum.S[k](0, 0).real();
    const double hertz = spectrum.omega[k] / (2.0 * std::numbers::pi * scene.step);
    all += power;
    half_hertz += hertz > 0.5 ? power : 0.0;
    more += hertz > 1.5 ? power : 0.0;
  }
  out.above_half_hertz = half_hertz / all;
  out.above_1_5_hertz = more / all;
}

void look_at_straights(Scene& scene) {
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
      entry.straight = quantile_of(std::move(values), 0.5) / unit_scale(scene.signal(kind));
    }
  }
}

void judge_identifiability(Scene& scene) {
  VehicleSurvey& out = scene.out;
  const bool slip = scene.has(SignalKind::vy) || scene.has(SignalKind::beta);
  const bool wheel = scene.has(SignalKind::steering) && scene.signal(SignalKind::steering).at_wheel;
  const auto say = [&](const char* of, const char* answer, std::string why) {
    out.verdicts.push_back({of, answer, std::move(why)});
  };
  if (scene.found("too_short") || scene.found("no_steering") || scene.found("no_speed") ||
      (scene.found("no_yaw_rate") && !scene.has(SignalKind::ay))) {
    say("Cf, Cr", "no",
        "steering angle, speed and yaw rate of a driven manoeuvre are not all there");
    return;
  }
  if (scene.found("no_yaw_rate")) {
    say("Cf, Cr", "poorly", "no yaw rate: what the others can tell was not looked at");
    return;
  }
  const double spread = out.speed[3] / out.speed[1];
  const bool several_speeds = spread > 2.0;
  // Dynamics show where the steering moves faster than the yaw motion settles.
  const bool quick = out.above_half_hertz > 0.05;
  const bool rather_quick = out.above_half_hertz > 0.005;
  const bool very_quick = out.above_1_5_hertz > 0.02;
  const bool circles = out.steady > 0.8 && out.above_half_hertz < 0.05;
  const std::string frequencies =
      std::isnan(out.above_half_hertz)
          ? "how fast the steering moves cannot be told from so few samples"
          : fmt::format("{:.2g} % of the steering's power lies above 0.5 Hz, {:.2g} % above 1.5 Hz",
                        100.0 * out.above_half_hertz, 100.0 * out.above_1_5_hertz);
  const std::string speeds =
      std::isnan(out.speed[1])
          ? "the car never turns"
          : fmt::format("turning at {:.0f} to {:.0f} m/s (5 to 95 %)", out.speed[1], out.speed[3]);
  const char* ratio = wheel ? "steering ratio" : "steering gain";
  // Strong steady cornering at several speeds tells gain from understeer.
  const double strong =
      out.lateral[2] + out.lateral[3] + out.lateral[4] + out.lateral[5] + out.lateral[6];
  const bool gain_told = several_speeds && strong > 0.05;
  const bool gain_weak = spread > 1.5 && strong > 0.05;
  const bool loaded = out.lateral[0] < 0.98;
  if (!loaded) {
    const std::string why = fmt::format(
        "the tyres are hardly loaded: |ay| stays below 1 m/s^2 {} of "
        "the time",
        percent(out.lateral[0]));
    say("Cf, Cr", "no", why);
    say("Iz", "no", why);
  } else if (circles) {
    say("Cf, Cr", "combination",
        fmt::format("steady circles tell i L and i K only, K = m (b Cr - a Cf)/(L Cf Cr){}",
                    slip ? "; with sideslip the rear axle too" : ""));
    say("Iz", "no", "yaw inertia acts only while the yaw rate changes; " + frequencies);
  } else if (slip) {
    say("Cf, Cr", quick || gain_told || gain_weak ? "yes" : "poorly",
        fmt::format("over mass, given the {}: sideslip tells the axles apart", ratio));
    say("Iz", quick ? "yes" : rather_quick ? "poorly" : "no", frequencies);
  } else if (very_quick) {
    say("Cf, Cr", "poorly",
        fmt::format("yaw rate without sideslip: only with m, a, b and the {} exact; {}", ratio,
                    frequencies));
    say("Iz", "poorly", "with Cf and Cr only: yaw rate without sideslip");
  } else {
    say("Cf, Cr", "combination",
        fmt::format("yaw rate without sideslip and {}: the understeer gradient, no more",
                    frequencies));
    say("Iz", "no", frequencies + "; without sideslip some above 1.5 Hz is needed");
  }
  const std::string which = wheel ? "steering_ratio" : "steering_gain";
  if (gain_told) {
    say(which.c_str(), circles ? "combination" : "yes",
        speeds + (circles ? ": times the wheelbase" : ", with some strength"));
  } else if (gain_weak) {
    say(which.c_str(), "poorly", speeds + ": a ratio above 2 tells it better");
  } else {
    say(which.c_str(), "no",
        speeds +
            (several_speeds ? fmt::format(", but only {} of it above 2 m/s^2", percent(strong))
                            : ": a ratio above 2, or a slow segment, is needed") +
            "; a wrong one makes wrong stiffnesses fit as well");
  }
  say("a, b", slip ? "poorly" : "no",
      slip ? "needs sideslip at several speeds; axle weights are better"
           : "needs sideslip, or axle weights");
  const double lesser = std::min(out.left, 1.0 - out.left);
  say("offsets", lesser > 0.2 || several_speeds ? "yes" : "no",
      std::isnan(out.left)
          ? std::string("steering offset, yaw bias, ay bias: the car never turns")
          : fmt::format("steering offset, yaw bias, ay bias: {} of turning is to the left{}",
                        percent(out.left), several_speeds ? ", several speeds" : ""));
}

}  // namespace identikal::surveying
