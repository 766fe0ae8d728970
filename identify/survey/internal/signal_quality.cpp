#include "identify/survey/internal/signal_quality.h"

#include <algorithm>
#include <cmath>
#include <set>

#include <fmt/format.h>

#include "lib/base/constants.h"
#include "lib/base/interpolation.h"
#include "lib/base/quantile.h"
#include "lib/data/units.h"

namespace identikal::surveying {

using Eigen::Index;
using Eigen::VectorXd;
namespace {

constexpr double kStanding = 0.3;      // [m/s]
constexpr double kFastestCar = 120.0;  // [m/s]

// Runs of one value: those up to half a second long are held samples, longer ones a quantity at
// rest.
struct Held {
  double of_all = 0.0, of_moving = 0.0;
};

Held held_share(const VehicleSignal& signal) {
  double held = 0.0, moving = 0.0, repeated = 0.0, all = 0.0;
  const VectorXd& x = signal.value;
  for (Index i = 0, end = 0; i < x.size(); i = end) {
    end = i + 1;
    if (std::isnan(x[i])) continue;
    // An empty cell neither repeats a sample nor ends what is held.
    double samples = 1.0;
    Index last = i;
    for (; end < x.size() && (x[end] == x[i] || std::isnan(x[end])); ++end) {
      if (std::isnan(x[end])) continue;
      samples += 1.0;
      last = end;
    }
    repeated += samples - 1.0;
    all += samples;
    if (signal.time[last] - signal.time[i] > 0.5) continue;
    held += samples - 1.0;
    moving += samples;
  }
  return {all > 0.0 ? repeated / all : 0.0, moving > 0.0 ? held / moving : 0.0};
}

// Samples that leap away from the median of their neighbours and back.
std::vector<Index> leaps(const VectorXd& t, const VectorXd& x) {
  const double period = own_period(t, x);
  std::vector<double> off;
  std::vector<Index> at;
  for (Index i = 3; i + 3 < x.size(); ++i) {
    if (std::isnan(x[i]) || t[i + 3] - t[i - 3] > 3.0 * 6.0 * period) continue;
    const double before = x[i] - quantile_of(VectorXd(x.segment(i - 3, 3)), 0.5);
    const double after = x[i] - quantile_of(VectorXd(x.segment(i + 1, 3)), 0.5);
    if (std::isnan(before) || std::isnan(after)) continue;
    // A step leaves one side only.
    off.push_back(before * after > 0.0 ? std::min(std::abs(before), std::abs(after)) : 0.0);
    at.push_back(i);
  }
  std::vector<Index> out;
  if (off.size() < 30) return out;
  const double usual = quantile(off, 0.5), often = quantile(off, 0.95);
  const double range = quantile_of(x, 0.95) - quantile_of(x, 0.05);
  for (std::size_t i = 0; i < off.size(); ++i) {
    if (off[i] > 20.0 * usual && off[i] > 6.0 * often && off[i] > 0.3 * range) {
      out.push_back(at[i]);
    }
  }
  return out;
}

}  // namespace

void list_signals(const VehicleSignals& signals, Scene& scene) {
  for (const VehicleSignal& s : signals.signals) {
    const double scale = unit_scale(s);
    VehicleSurvey::Signal entry{to_string(s.kind), s.column, s.unit, s.source};
    const std::vector<double> values = present(s.value);
    entry.rate = 1.0 / own_period(s.time, s.value);
    if (!values.empty()) {
      entry.min = *std::min_element(values.begin(), values.end()) / scale;
      entry.max = *std::max_element(values.begin(), values.end()) / scale;
    }
    const bool constant = values.empty() || entry.min == entry.max;
    const Held held = held_share(s);
    entry.held = held.of_all;
    entry.quantum = quantum_of(s.value) / scale;
    scene.out.signals.push_back(entry);
    const bool used = scene.first.contains(s.kind) && scene.first.at(s.kind) == &s;
    const bool speed = s.kind == SignalKind::vx || s.kind == SignalKind::wheel_speed;
    if (constant && !values.empty() && speed && values.front() != 0.0) continue;  // driven so
    if (constant) {
      const std::string what = values.empty() ? "holds no number" : "never changes";
      if (s.kind != SignalKind::steering) {
        scene.add_finding(FindingCode::dead_channel, used ? Severity::serious : Severity::note,
                          {s.column},
                          fmt::format("'{}' ({}) {}", s.column, to_string(s.kind), what),
                          "leave it out, or find out why the sensor is silent");
      }
      continue;
    }
    if (!used) continue;
    const double spread = (quantile(values, 0.95) - quantile(values, 0.05)) / 3.3 / scale;
    if (held.of_moving > 0.4) {
      scene.add_finding(
          FindingCode::held_samples, Severity::warning, {s.column},
          fmt::format(
              "'{}' repeats the sample before in {} of its samples ({} while it moves), in steps "
              "of {} {}{}",
              s.column, percent(held.of_all), percent(held.of_moving), shown(entry.quantum), s.unit,
              spread > 0.0 ? fmt::format(", {} of its spread", percent(entry.quantum / spread))
                           : ""),
          "a slow bus, or coarse steps: its rows are not independent, and standard errors that "
          "take them so are too small");
    }
    const std::vector<Index> odd = leaps(s.time, s.value);
    if (!odd.empty()) {
      std::string where;
      for (std::size_t i = 0; i < std::min<std::size_t>(3, odd.size()); ++i) {
        where += fmt::format("{}{:.6g} s", i > 0 ? ", " : "", s.time[odd[i]]);
      }
      scene.add_finding(
          FindingCode::outliers,
          odd.size() > 3 || s.kind != SignalKind::ay ? Severity::warning : Severity::note,
          {s.column},
          fmt::format("{} sample{} of '{}' leap{} away from both neighbours, at {}{}", odd.size(),
                      odd.size() == 1 ? "" : "s", s.column, odd.size() == 1 ? "s" : "", where,
                      odd.size() > 3 ? ", ..." : ""),
          "leave them empty in the file, or use a robust loss");
    }
  }
}

void measure_speed(Scene& scene) {
  // A model car never is as fast as the least speed of a passenger car.
  constexpr double kShareOfFast = 0.4;
  const double fast = quantile_of(scene.speed, 0.95);
  if (fast > 0.0 && kShareOfFast * fast < 0.5 * kSlowestUse) {
    scene.out.least_speed = std::max(0.5, std::round(10.0 * kShareOfFast * fast) / 10.0);
  }
  double known = 0, standing = 0, reversing = 0, moving = 0;
  for (const double v : scene.speed) {
    if (std::isnan(v)) continue;
    ++known;
    standing += std::abs(v) < kStanding ? 1 : 0;
    reversing += v < -kStanding ? 1 : 0;
    moving += v > scene.out.least_speed ? 1 : 0;
  }
  VehicleSurvey& out = scene.out;
  out.duration = known * scene.step;
  out.standstill = known > 0 ? standing / known : kNaN;
  out.reversing = known > 0 ? reversing / known : kNaN;
  out.moving = moving * scene.step;
  if (out.standstill > 0.02) {
    scene.add_finding(
        FindingCode::standstill, Severity::note,
        {scene.signal(scene.has(SignalKind::vx) ? SignalKind::vx : SignalKind::wheel_speed).column},
        fmt::format("the car stands for {} of the time", percent(out.standstill)),
        fmt::format("use_when: \"vx > {:g}\" leaves these rows out", scene.out.least_speed));
  }
  if (reversing * scene.step > 0.5) {
    scene.add_finding(
        FindingCode::reversing, Severity::warning, {},
        fmt::format("{} is negative for {:.1f} s: the car reverses, or its axis points backwards",
                    scene.speed_name, reversing * scene.step),
        fmt::format("use_when: \"vx > {:g}\" leaves reversing out; if the car drives forward "
                    "there, scale: -1",
                    scene.out.least_speed));
  }
  const double fastest = quantile_of(scene.speed, 0.99);
  if (known > 0 && fastest > kFastestCar) {
    scene.add_finding(
        FindingCode::units_speed, Severity::serious, {},
        fmt::format("{} reaches {:.0f} m/s, expected at most {:.0f} m/s ({:.0f} km/h) of a car",
                    scene.speed_name, fastest, kFastestCar,
                    unit_or_dimensionless("km/h").from_si(kFastestCar)),
        "if the file has it in km/h, write unit: km/h for this column in the model file");
  }
}

void check_stuck(Scene& scene) {
  struct Follows {
    SignalKind kind, with;
  };
  const Follows pairs[] = {
      {SignalKind::r, SignalKind::ay},           {SignalKind::ay, SignalKind::r},
      {SignalKind::r, SignalKind::steering},     {SignalKind::steering, SignalKind::r},
      {SignalKind::vx, SignalKind::wheel_speed}, {SignalKind::wheel_speed, SignalKind::vx},
      {SignalKind::vy, SignalKind::r},           {SignalKind::beta, SignalKind::r}};
  std::set<SignalKind> named;
  for (const Follows& p : pairs) {
    if (!scene.has(p.kind) || !scene.has(p.with) || named.contains(p.kind)) continue;
    const VectorXd& x = scene.on[p.kind];
    const VectorXd& y = scene.smooth[p.with];
    const double range = quantile_of(y, 0.95) - quantile_of(y, 0.05);
    // A coarse quantity rests on one step while what it follows moves less than that.
    const double steps = (quantile_of(x, 0.95) - quantile_of(x, 0.05)) /
                         std::max(quantum_of(scene.signal(p.kind).value), 1e-300);
    if (!(range > 0.0) || !(steps > 4.0)) continue;
    double frozen = 0.0, begin = kNaN;
    for (Index i = 0, end = 0; i < x.size(); i = end) {
      for (end = i + 1; end < x.size() && x[end] == x[i];) ++end;
      if (std::isnan(x[i]) || scene.time[end - 1] - scene.time[i] < 1.0) continue;
      const auto during = present(while_driving(scene, y, kSlowestTest).segment(i, end - i));
      if (during.size() < 8) continue;
      const double moved = quantile(during, 0.95) - quantile(during, 0.05);
      if (moved < (0.4 + 2.0 / steps) * range) continue;
      frozen += scene.time[end - 1] - scene.time[i];
      if (std::isnan(begin)) begin = scene.time[i];
    }
    if (std::isnan(begin)) continue;
    named.insert(p.kind);
    scene.add_finding(
        FindingCode::stuck_channel, Severity::serious, {scene.signal(p.kind).column},
        fmt::format("{} stands still for {:.1f} s in all, from {:.6g} s, while {} moves",
                    scene.name(p.kind), frozen, begin, scene.name(p.with)),
        "leave these rows out with --range: the sensor or its bus was silent");
  }
}

}  // namespace identikal::surveying
