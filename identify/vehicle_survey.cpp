#include "identify/vehicle_survey.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <set>

#include <fmt/format.h>

#include "lib/clock_offset.h"
#include "lib/constants.h"
#include "lib/interpolation.h"
#include "lib/nearest_name.h"
#include "lib/spectrum.h"
#include "lib/units.h"

namespace identikal {
namespace {

using Eigen::ArrayXd;
using Eigen::Index;
using Eigen::VectorXd;

constexpr double kSlowestUse = 3.0;     // [m/s]: use_when proposed; the single-track model needs it
constexpr double kSlowestTest = 1.5;    // [m/s]: below, v r and v delta say little
constexpr double kStanding = 0.3;       // [m/s]
constexpr double kTypicalSpeed = 25.0;  // [m/s]: characteristic speed of a usual car
constexpr double kSmoothing = 0.3;      // [s]: kinematics are compared on means over so long
constexpr double kFarLag = 5.0;         // [s]
constexpr double kTurning = 0.05;       // [rad/s]

// --- Small statistics of samples that may be missing ---

std::vector<double> present(const VectorXd& x) {
  std::vector<double> out;
  for (const double v : x) {
    if (!std::isnan(v)) out.push_back(v);
  }
  return out;
}

double quantile_of(std::vector<double> values, double p) {
  if (values.empty()) return kNaN;
  const auto at = static_cast<std::ptrdiff_t>(p * static_cast<double>(values.size() - 1) + 0.5);
  std::nth_element(values.begin(), values.begin() + at, values.end());
  return values[static_cast<std::size_t>(at)];
}

double quantile_of(const VectorXd& x, double p) { return quantile_of(present(x), p); }

struct Pair {
  double correlation = kNaN;
  double slope = kNaN;  // sd of y over sd of x
  Index count = 0;
};

Pair compare_pair(const VectorXd& x, const VectorXd& y) {
  double n = 0, sx = 0, sy = 0, sxx = 0, syy = 0, sxy = 0;
  for (Index i = 0; i < x.size(); ++i) {
    if (std::isnan(x[i]) || std::isnan(y[i])) continue;
    n += 1;
    sx += x[i];
    sy += y[i];
    sxx += x[i] * x[i];
    syy += y[i] * y[i];
    sxy += x[i] * y[i];
  }
  Pair out;
  out.count = static_cast<Index>(n);
  if (n < 8) return out;
  const double vx = sxx - sx * sx / n, vy = syy - sy * sy / n;
  if (!(vx > 1e-12 * sxx && vy > 1e-12 * syy)) return out;
  out.correlation = (sxy - sx * sy / n) / std::sqrt(vx * vy);
  out.slope = std::sqrt(vy / vx);
  return out;
}

// Mean over a window around every sample, of what is there; NaN where less than half is.
VectorXd smoothed(const VectorXd& x, Index half) {
  VectorXd out(x.size());
  double sum = 0.0;
  Index count = 0, begin = 0, end = 0;
  for (Index i = 0; i < x.size(); ++i) {
    for (; end <= std::min(i + half, x.size() - 1); ++end) {
      if (std::isnan(x[end])) continue;
      sum += x[end];
      ++count;
    }
    for (; begin < i - half; ++begin) {
      if (std::isnan(x[begin])) continue;
      sum -= x[begin];
      --count;
    }
    out[i] = 2 * count > half ? sum / static_cast<double>(count) : kNaN;
  }
  return out;
}

// What a first-order lag makes of x on a uniform raster; starts anew after a gap.
VectorXd lagged(const VectorXd& x, double step, double time_constant) {
  if (time_constant <= 0.0) return x;
  VectorXd out(x.size());
  const double keep = std::exp(-step / time_constant);
  double state = kNaN;
  for (Index i = 0; i < x.size(); ++i) {
    state = std::isnan(x[i]) ? kNaN : std::isnan(state) ? x[i] : keep * state + (1.0 - keep) * x[i];
    out[i] = state;
  }
  return out;
}

std::string shown(double value) { return fmt::format("{:.3g}", value); }

std::string percent(double share) { return fmt::format("{:.0f} %", 100.0 * share); }

// --- The recording on one raster ---

struct Scene {
  VehicleSurvey out;
  std::map<SignalKind, const VehicleSignal*> first;
  VectorXd time;
  double step = kNaN;
  std::map<SignalKind, VectorXd> on;      // on the raster
  std::map<SignalKind, VectorXd> smooth;  // the same, averaged
  VectorXd speed;                         // what stands for vx
  std::string speed_name;
  double axis_sign = 1.0;  // of r and ay, when both point the other way

  bool has(SignalKind kind) const { return on.contains(kind); }
  const VehicleSignal& signal(SignalKind kind) const { return *first.at(kind); }
  std::string name(SignalKind kind) const { return "'" + signal(kind).column + "'"; }
  void find(const char* code, const char* severity, std::vector<std::string> about,
            std::string text, std::string todo) {
    out.findings.push_back({code, severity, std::move(about), std::move(text), std::move(todo)});
  }
  bool found(std::string_view code) const {
    return std::any_of(out.findings.begin(), out.findings.end(),
                       [code](const Warning& w) { return w.code == code; });
  }
  VehicleSurvey::Proposal* proposal(SignalKind kind) {
    for (VehicleSurvey::Proposal& p : out.mapping) {
      if (signal_kind(p.name) == kind) return &p;
    }
    return nullptr;
  }
};

double unit_scale(const VehicleSignal& signal) {
  return parse_unit(signal.unit).value_or(Unit{}).scale;
}

// --- Each signal on its own ---

// Runs of one value: those up to half a second long are held samples, longer ones a quantity at
// rest.
struct Held {
  double of_all = 0.0, of_moving = 0.0;
};

Held held_share(const VehicleSignal& signal) {
  double held = 0.0, moving = 0.0, repeated = 0.0, all = 0.0;
  const VectorXd& x = signal.value;
  for (Index i = 0, end = 0; i < x.size(); i = end) {
    for (end = i + 1; end < x.size() && (x[end] == x[i] || std::isnan(x[end]));) ++end;
    if (std::isnan(x[i])) continue;
    repeated += static_cast<double>(end - i - 1);
    all += static_cast<double>(end - i);
    if (signal.time[end - 1] - signal.time[i] > 0.5) continue;
    held += static_cast<double>(end - i - 1);
    moving += static_cast<double>(end - i);
  }
  return {all > 0.0 ? repeated / all : 0.0, moving > 0.0 ? held / moving : 0.0};
}

double quantum_of(const VectorXd& x) {
  std::vector<double> values = present(x);
  std::sort(values.begin(), values.end());
  if (values.empty()) return kNaN;
  // What rounding leaves of a decimal fraction is no step.
  const double rounding = 1e-9 * std::max(std::abs(values.front()), std::abs(values.back()));
  double least = kNaN;
  for (std::size_t i = 1; i < values.size(); ++i) {
    const double step = values[i] - values[i - 1];
    if (step > rounding && !(step >= least)) least = step;
  }
  return least;
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
  const double usual = quantile_of(off, 0.5), often = quantile_of(off, 0.95);
  const double range = quantile_of(x, 0.95) - quantile_of(x, 0.05);
  for (std::size_t i = 0; i < off.size(); ++i) {
    if (off[i] > 20.0 * usual && off[i] > 6.0 * often && off[i] > 0.3 * range) {
      out.push_back(at[i]);
    }
  }
  return out;
}

void look_at_signals(const VehicleSignals& signals, Scene& scene) {
  for (const VehicleSignal& s : signals.signals) {
    const double scale = unit_scale(s);
    VehicleSurvey::Signal entry{to_string(s.kind), s.column, s.unit, s.source};
    const std::vector<double> values = present(s.value);
    entry.rate = 1.0 / own_period(s.time, s.value);
    if (!values.empty()) {
      entry.lowest = *std::min_element(values.begin(), values.end()) / scale;
      entry.highest = *std::max_element(values.begin(), values.end()) / scale;
    }
    const bool constant = values.empty() || entry.lowest == entry.highest;
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
        scene.find("dead_channel", used ? "serious" : "note", {s.column},
                   fmt::format("'{}' ({}) {}", s.column, to_string(s.kind), what),
                   "leave it out, or find out why the sensor is silent");
      }
      continue;
    }
    if (!used) continue;
    const double spread = (quantile_of(values, 0.95) - quantile_of(values, 0.05)) / 3.3 / scale;
    if (held.of_moving > 0.4) {
      scene.find(
          "held_samples", "warning", {s.column},
          fmt::format("'{}' repeats the sample before in {} of its rows ({} while it moves), in "
                      "steps of {} {}, {} of its spread",
                      s.column, percent(held.of_all), percent(held.of_moving), shown(entry.quantum),
                      s.unit, percent(entry.quantum / std::max(spread, 1e-300))),
          "a slow bus, or coarse steps: its rows are not independent, and standard errors that "
          "take "
          "them so are too small");
    }
    const std::vector<Index> odd = leaps(s.time, s.value);
    if (!odd.empty()) {
      std::string where;
      for (std::size_t i = 0; i < std::min<std::size_t>(3, odd.size()); ++i) {
        where += fmt::format("{}{:.6g} s", i > 0 ? ", " : "", s.time[odd[i]]);
      }
      scene.find("outliers", odd.size() > 3 || s.kind != SignalKind::ay ? "warning" : "note",
                 {s.column},
                 fmt::format("{} sample{} of '{}' leap{} away from both neighbours, at {}{}",
                             odd.size(), odd.size() == 1 ? "" : "s", s.column,
                             odd.size() == 1 ? "s" : "", where, odd.size() > 3 ? ", ..." : ""),
                 "leave them empty in the file, or use a robust loss");
    }
  }
}

// --- The raster ---

bool make_raster(const VehicleSignals& signals, Scene& scene) {
  for (const VehicleSignal& s : signals.signals) scene.first.try_emplace(s.kind, &s);
  look_at_signals(signals, scene);
  const SignalKind bases[] = {SignalKind::r, SignalKind::ay, SignalKind::vx,
                              SignalKind::wheel_speed, SignalKind::steering};
  const auto base = std::find_if(std::begin(bases), std::end(bases),
                                 [&](SignalKind kind) { return scene.first.contains(kind); });
  if (base == std::end(bases)) return false;
  const VehicleSignal& reference = scene.signal(*base);
  scene.time = reference.time;
  if (scene.time.size() < 2) return false;
  scene.step = own_period(scene.time, scene.time);
  const auto half = static_cast<Index>(std::lround(0.5 * kSmoothing / scene.step));
  for (const auto& [kind, signal] : scene.first) {
    const double period = own_period(signal->time, signal->value);
    scene.on[kind] =
        interpolate_linearly(signal->time, signal->value, scene.time, kBridgedPeriods * period);
    scene.smooth[kind] = smoothed(scene.on[kind], half);
  }
  for (const SignalKind kind : {SignalKind::vx, SignalKind::wheel_speed}) {
    if (!scene.has(kind) || scene.speed.size() > 0) continue;
    scene.speed = scene.on[kind];
    scene.speed_name = scene.name(kind);
  }
  return true;
}

// x where the car drives faster than `speed`, else missing.
VectorXd while_driving(const Scene& scene, const VectorXd& x, double speed) {
  VectorXd out = x;
  for (Index i = 0; i < out.size(); ++i) {
    if (!(scene.speed[i] > speed)) out[i] = kNaN;
  }
  return out;
}

// --- Speed ---

void look_at_speed(Scene& scene) {
  double known = 0, standing = 0, reversing = 0, moving = 0;
  for (const double v : scene.speed) {
    if (std::isnan(v)) continue;
    ++known;
    standing += std::abs(v) < kStanding ? 1 : 0;
    reversing += v < -kStanding ? 1 : 0;
    moving += v > kSlowestUse ? 1 : 0;
  }
  VehicleSurvey& out = scene.out;
  out.duration = known * scene.step;
  out.standstill = known > 0 ? standing / known : kNaN;
  out.reversing = known > 0 ? reversing / known : kNaN;
  out.moving = moving * scene.step;
  if (out.standstill > 0.02) {
    scene.find(
        "standstill", "note",
        {scene.signal(scene.has(SignalKind::vx) ? SignalKind::vx : SignalKind::wheel_speed).column},
        fmt::format("the car stands for {} of the time", percent(out.standstill)),
        "use_when: \"vx > 3\" leaves these rows out");
  }
  if (reversing * scene.step > 0.5) {
    scene.find("reversing", "warning", {},
               fmt::format("{} is negative for {:.1f} s: the car reverses, or its axis points "
                           "backwards",
                           scene.speed_name, reversing * scene.step),
               "use_when: \"vx > 3\" leaves reversing out; if the car drives forward there, scale: "
               "-1");
  }
  if (known > 0 && quantile_of(scene.speed, 0.99) > 120.0) {
    scene.find(
        "units_speed", "serious", {},
        fmt::format("{} reaches {:.0f} m/s", scene.speed_name, quantile_of(scene.speed, 0.99)),
        "is it in km/h? Its unit belongs into the mapping");
  }
}

// --- Kinematics: vx r against ay ---

// What vx r / ay is off by where units were mistaken.
struct UnitGuess {
  double off;
  const char* words;
};
constexpr double kDeg = std::numbers::pi / 180.0;
constexpr double kG = 9.80665;
constexpr UnitGuess kUnitGuesses[] = {
    {kG, "ay is in g, taken as m/s^2"},
    {1.0 / kG, "ay is in m/s^2, taken as g"},
    {1.0 / kDeg, "r is in deg/s, taken as rad/s"},
    {kDeg, "r is in rad/s, taken as deg/s"},
    {3.6, "vx is in km/h, taken as m/s"},
    {1.0 / 3.6, "vx is in m/s, taken as km/h"},
    {kG / kDeg, "r is in deg/s and ay in g, taken as rad/s and m/s^2"},
    {3.6 / kDeg, "vx is in km/h and r in deg/s, taken as m/s and rad/s"},
    {3.6 * kG, "vx is in km/h and ay in g, taken as m/s and m/s^2"},
    {3.6 * kG / kDeg, "vx is in km/h, r in deg/s and ay in g, taken as SI"},
};

bool near_one(double ratio) { return ratio > 0.6 && ratio < 1.6; }

void check_swapped(Scene& scene) {
  if (scene.has(SignalKind::vx) && scene.has(SignalKind::vy)) {
    const double vx = quantile_of(scene.on[SignalKind::vx].cwiseAbs(), 0.9);
    const double vy = quantile_of(scene.on[SignalKind::vy].cwiseAbs(), 0.9);
    if (vy > vx && vy > 1.0) {
      scene.find(
          "swapped_channels", "serious",
          {scene.signal(SignalKind::vx).column, scene.signal(SignalKind::vy).column},
          fmt::format("{} as vx is mostly smaller than {} as vy ({} against {} m/s): a car "
                      "drives forward, not sideways",
                      scene.name(SignalKind::vx), scene.name(SignalKind::vy), shown(vx), shown(vy)),
          "exchange the two columns");
    }
  }
  if (!scene.has(SignalKind::r) || !scene.has(SignalKind::ay)) return;
  // As it is, first; then with r and ay exchanged, each in the units it may have been written in.
  const auto fits = [&](const VectorXd& r, const VectorXd& ay) {
    const VectorXd x = while_driving(scene, scene.speed.cwiseProduct(r), kSlowestTest);
    return compare_pair(x, ay);
  };
  const VectorXd& r = scene.smooth[SignalKind::r];
  const VectorXd& ay = scene.smooth[SignalKind::ay];
  const Pair straight = fits(r, ay);
  if (near_one(straight.slope) && std::abs(straight.correlation) > 0.7) return;
  for (const UnitGuess& guess : kUnitGuesses) {
    const bool fitting = straight.slope * guess.off > 0.8 && straight.slope * guess.off < 1.25;
    if (fitting && std::abs(straight.correlation) > 0.9) return;  // units explain it
  }
  const double raw_r = unit_scale(scene.signal(SignalKind::r));
  const double raw_ay = unit_scale(scene.signal(SignalKind::ay));
  for (const double as_r : {1.0, kDeg}) {
    for (const double as_ay : {1.0, kG}) {
      const Pair crossed = fits(ay / raw_ay * as_r, r / raw_r * as_ay);
      const bool better = std::abs(crossed.correlation) > 0.8 &&
                          std::abs(crossed.correlation) >= std::abs(straight.correlation) - 0.02;
      if (!better || !(crossed.slope > 0.75 && crossed.slope < 1.33)) continue;
      scene.find("swapped_channels", "serious",
                 {scene.signal(SignalKind::r).column, scene.signal(SignalKind::ay).column},
                 fmt::format("{} behaves like ay and {} like r: vx {} = {} then holds within {}",
                             scene.name(SignalKind::r), scene.name(SignalKind::ay),
                             scene.name(SignalKind::ay), scene.name(SignalKind::r),
                             percent(std::abs(crossed.slope - 1.0))),
                 "exchange the two columns");
      return;
    }
  }
}

VehicleSurvey::Relation relate(const VectorXd& time, const VectorXd& x, const VectorXd& y,
                               const std::string& expected, const std::string& seen) {
  VehicleSurvey::Relation out;
  out.expected = expected;
  out.seen = seen;
  const double span = time[time.size() - 1] - time[0];
  const double reach = std::min(kFarLag, 0.25 * span);
  if (!(reach > 0.0)) return out;
  ClockOffset c = clock_offset(time, x, time, y, reach);
  // Of something that swings, half a period's shift looks like the other sign: unless the
  // correlation without shift is poor, its sign is the right one.
  if (std::abs(c.at_zero) > 0.5 && c.at_zero * c.correlation < 0.0) {
    c = clock_offset(time, x, time, y, reach,
                     c.at_zero > 0.0 ? Relation::same_sign : Relation::opposite_sign);
  }
  out.correlation = c.correlation;
  out.slope = compare_pair(x, y).slope;
  out.lag = c.lag;
  out.lag_se = c.se;
  out.other_lag = c.other_lag;
  out.other_correlation = c.other_correlation;
  // What a car's own dynamics and the smoothing may do to the peak stays below `least`.
  const double height = std::abs(c.correlation);
  out.clock = height > 0.6 && !c.at_edge && height > std::abs(c.at_zero) + 0.01;
  return out;
}

// The lag is too large for anything but clocks, and certain.
void judge_clock(Scene& scene, VehicleSurvey::Relation& relation, double least, SignalKind late) {
  const double height = std::abs(relation.correlation);
  const bool far = std::abs(relation.lag) > least + 3.0 * relation.lag_se;
  relation.clock = relation.clock && far;
  if (!relation.clock) return;
  const bool unclear = std::abs(relation.other_correlation) > height - 0.03;
  const std::string where = fmt::format(
      "{} comes {:.2f} +- {:.2f} s {} than {} (correlation {:.2f} there{})", relation.seen,
      std::abs(relation.lag), relation.lag_se, relation.lag > 0.0 ? "later" : "earlier",
      relation.expected, relation.correlation,
      unclear ? fmt::format(", {:.2f} at {:.2f} s", relation.other_correlation, relation.other_lag)
              : "");
  if (unclear) {
    relation.clock = false;
    scene.find("clock_unclear", "note", {scene.signal(late).column}, where,
               "something that swings regularly looks alike a period later: compare by eye");
    return;
  }
  scene.find(
      "clock_offset", "serious", {scene.signal(late).column}, where,
      "shift it by 'delay' in the model file: a search that starts without shift stays wrong");
}

// dvy/dt on the raster, over the length of the smoothing; empty when nothing tells vy.
VectorXd lateral_rate(const Scene& scene) {
  if (!scene.has(SignalKind::vy) && !scene.has(SignalKind::beta)) return {};
  const SignalKind kind = scene.has(SignalKind::vy) ? SignalKind::vy : SignalKind::beta;
  VectorXd vy = scene.smooth.at(kind);
  if (kind == SignalKind::beta) vy = vy.cwiseProduct(scene.speed);
  VectorXd rate = VectorXd::Constant(vy.size(), kNaN);
  const auto half = std::max<Index>(1, std::lround(0.25 * kSmoothing / scene.step));
  for (Index i = half; i + half < vy.size(); ++i) {
    rate[i] = (vy[i + half] - vy[i - half]) / (scene.time[i + half] - scene.time[i - half]);
  }
  return rate;
}

void check_acceleration(Scene& scene) {
  if (!scene.has(SignalKind::r) || !scene.has(SignalKind::ay)) return;
  VectorXd expected =
      while_driving(scene, scene.speed.cwiseProduct(scene.smooth[SignalKind::r]), kSlowestTest);
  const VectorXd seen = while_driving(scene, scene.smooth[SignalKind::ay], kSlowestTest);
  VehicleSurvey::Relation relation = relate(scene.time, expected, seen, "vx r", "ay");
  // Without dvy/dt the car's own dynamics shift the one against the other; which of the two mirrors
  // vy is another question.
  double least = 0.25;
  if (const VectorXd rate = lateral_rate(scene); rate.size() > 0) {
    for (const double sign : {1.0, -1.0}) {
      VehicleSurvey::Relation with = relate(scene.time, expected + sign * rate, seen, "vx r", "ay");
      if (!(std::abs(with.correlation) > std::abs(relation.correlation) + 0.002)) continue;
      with.slope = relation.slope;
      relation = with;
      least = 0.1;
    }
  }
  if (!scene.found("swapped_channels")) {
    judge_clock(scene, relation, least, SignalKind::ay);
    const double ratio = 1.0 / relation.slope;  // vx r over ay
    if (std::abs(relation.correlation) > 0.7 && !near_one(relation.slope)) {
      std::string guess;
      for (const UnitGuess& unit : kUnitGuesses) {
        if (std::abs(std::log(ratio / unit.off)) > std::log(1.3)) continue;
        guess += (guess.empty() ? "" : ", or ") + std::string(unit.words);
      }
      scene.find("units_ay", "serious",
                 {scene.signal(SignalKind::ay).column, scene.signal(SignalKind::r).column},
                 fmt::format("{} is {} times {} times {}, and should be about once that",
                             scene.name(SignalKind::ay), shown(relation.slope), scene.speed_name,
                             scene.name(SignalKind::r)),
                 guess.empty() ? "check the units of the three" : guess + "?");
    }
  }
  scene.out.relations.push_back(relation);
}

// --- Steering against yaw rate ---

struct Steered {
  VehicleSurvey::Relation relation;
  double length = kNaN;  // vx delta / r at low lateral acceleration [m]
};

Steered compare_steering(Scene& scene) {
  // A usual car's yaw motion takes about so long; that it is not known better is an error of the
  // lag.
  constexpr double kYawLag = 0.1, kYawLagError = 0.05;
  const VectorXd& v = scene.speed;
  const VectorXd gain = v.array() / (1.0 + (v.array() / kTypicalSpeed).square());
  const VehicleSignal& steering = scene.signal(SignalKind::steering);
  const double widest = kBridgedPeriods * own_period(steering.time, steering.value);
  const VectorXd y = while_driving(scene, scene.on[SignalKind::r], kSlowestTest);
  Steered out;
  VectorXd x;
  double lag = 0.0;
  // Steering has to meet the speed of its own time, so that the lag is found in a few passes.
  for (int pass = 0; pass < 4; ++pass) {
    const VectorXd delta =
        interpolate_linearly(steering.time, steering.value, scene.time.array() - lag, widest);
    x = while_driving(scene, gain.cwiseProduct(delta), kSlowestTest);
    VehicleSurvey::Relation one =
        relate(scene.time, lagged(x, scene.step, kYawLag), y, "steering", "r");
    if (!std::isfinite(one.lag)) break;
    if (pass == 0) {
      out.relation = one;
    } else if (std::abs(lag + one.lag) < kFarLag) {
      out.relation.correlation = one.correlation;
      out.relation.slope = one.slope;
      out.relation.lag = lag + one.lag;
      out.relation.lag_se = one.lag_se;
    } else {
      break;
    }
    lag = out.relation.lag;
    // Only a lag of clocks is worth it.
    if (!out.relation.clock || std::abs(one.lag) < 0.01) break;
  }
  out.relation.lag_se = std::hypot(out.relation.lag_se, kYawLagError);
  VectorXd slow = x;
  for (Index i = 0; i < slow.size(); ++i) {
    if (std::abs(v[i] * y[i]) > 4.0) slow[i] = kNaN;
  }
  const Pair low = compare_pair(slow, y);
  out.length = 1.0 / low.slope;
  return out;
}

void check_steering(Scene& scene) {
  if (!scene.has(SignalKind::steering) || !scene.has(SignalKind::r)) return;
  const VectorXd steering = while_driving(scene, scene.on[SignalKind::steering], kSlowestTest);
  const double low = quantile_of(steering, 0.0), high = quantile_of(steering, 1.0);
  const bool at_wheel = scene.signal(SignalKind::steering).at_wheel;
  if (!(high - low > (at_wheel ? 0.02 : 0.001))) {
    scene.find("no_steering", "serious", {scene.signal(SignalKind::steering).column},
               fmt::format("the steering angle stays within {} rad while the car drives",
                           std::isnan(high - low) ? "0" : shown(high - low)),
               "is it the right column, and its unit right? Else record a manoeuvre");
    return;
  }
  Steered steered = compare_steering(scene);
  VehicleSurvey::Relation& relation = steered.relation;
  judge_clock(scene, relation, 0.15, SignalKind::r);
  if (relation.clock) {
    // The kinematics between yaw rate, ay and speed hold: it is the steering that comes early.
    Warning& w = scene.out.findings.back();
    w.about = {scene.signal(SignalKind::steering).column};
    w.text = fmt::format(
        "{} is {:.2f} +- {:.2f} s {} than the yaw rate says (correlation {:.2f} "
        "there)",
        scene.name(SignalKind::steering), std::abs(relation.lag), relation.lag_se,
        relation.lag > 0.0 ? "earlier" : "later", relation.correlation);
  }
  const double least = at_wheel ? 12.0 : 0.7, most = at_wheel ? 150.0 : 12.0;
  if (std::abs(relation.correlation) > 0.6 && std::isfinite(steered.length) &&
      !(steered.length > least && steered.length < most)) {
    struct Reading {
      double factor;
      bool wheel;
      const char* words;
    };
    const Reading readings[] = {{1.0, false, "an angle of the road wheels"},
                                {1.0, true, "an angle of the steering wheel"},
                                {kDeg, true, "a steering-wheel angle in deg, taken as rad"},
                                {kDeg, false, "a road-wheel angle in deg, taken as rad"},
                                {1.0 / kDeg, true, "a steering-wheel angle in rad, taken as deg"},
                                {1.0 / kDeg, false, "a road-wheel angle in rad, taken as deg"}};
    std::string guess;
    for (const Reading& reading : readings) {
      const double length = steered.length * reading.factor;
      if (!(length > (reading.wheel ? 20.0 : 1.2) && length < (reading.wheel ? 90.0 : 6.0)))
        continue;
      guess += (guess.empty() ? "is it " : ", or ") + std::string(reading.words);
    }
    scene.find("units_steering", "serious", {scene.signal(SignalKind::steering).column},
               fmt::format("vx delta / r is {} m; wheelbase times steering ratio of a car is 20 to "
                           "90 m, its wheelbase 1.2 to 6 m",
                           shown(steered.length)),
               guess.empty() ? "check the units of steering, vx and r" : guess + "?");
  }
  scene.out.relations.push_back(relation);
}

// --- Wheels against vx, sideslip ---

void check_wheels(Scene& scene) {
  if (!scene.has(SignalKind::vx) || !scene.has(SignalKind::wheel_speed)) return;
  VehicleSurvey::Relation relation =
      relate(scene.time, scene.smooth[SignalKind::vx], scene.smooth[SignalKind::wheel_speed], "vx",
             "wheel speed");
  judge_clock(scene, relation, 0.08, SignalKind::wheel_speed);
  scene.out.relations.push_back(relation);
}

void check_sideslip(Scene& scene) {
  if (scene.has(SignalKind::vy) && scene.has(SignalKind::beta)) {
    const VectorXd angle =
        while_driving(scene, scene.smooth[SignalKind::vy].cwiseQuotient(scene.speed), kSlowestUse);
    const VectorXd beta = while_driving(scene, scene.smooth[SignalKind::beta], kSlowestUse);
    VehicleSurvey::Relation relation = relate(scene.time, angle, beta, "vy / vx", "beta");
    judge_clock(scene, relation, 0.08, SignalKind::beta);
    if (relation.correlation < -0.7) {
      scene.find("sign_vy", "serious",
                 {scene.signal(SignalKind::vy).column, scene.signal(SignalKind::beta).column},
                 fmt::format("{} and {} have opposite signs", scene.name(SignalKind::vy),
                             scene.name(SignalKind::beta)),
                 "ISO 8855: vy to the left is positive, beta = atan(vy/vx)");
    }
    scene.out.relations.push_back(relation);
  }
  const VectorXd rate = lateral_rate(scene);
  if (rate.size() == 0 || !scene.has(SignalKind::r) || !scene.has(SignalKind::ay)) return;
  const VectorXd left_over =
      scene.smooth[SignalKind::ay] - scene.speed.cwiseProduct(scene.smooth[SignalKind::r]);
  VehicleSurvey::Relation relation;
  relation.expected = "ay - vx r";
  relation.seen = "dvy/dt";
  const Pair pair = compare_pair(while_driving(scene, left_over, kSlowestUse), rate);
  relation.correlation = pair.correlation;
  relation.slope = pair.slope;
  scene.out.relations.push_back(relation);
}

// --- Signs ---

double correlation_of(const Scene& scene, std::string_view expected) {
  for (const VehicleSurvey::Relation& r : scene.out.relations) {
    if (r.expected == expected) return r.correlation;
  }
  return kNaN;
}

void flip(Scene& scene, SignalKind kind) {
  if (VehicleSurvey::Proposal* p = scene.proposal(kind)) {
    p->scale = -p->scale;
    p->offset = -p->offset;
  }
}

void check_signs_of(Scene& scene) {
  if (scene.found("swapped_channels")) return;
  const double with_r = correlation_of(scene, "steering"), with_ay = correlation_of(scene, "vx r");
  const double with_vy = correlation_of(scene, "ay - vx r");
  const bool steering_off = with_r < -0.5, ay_off = with_ay < -0.5;
  const auto axis = [&](SignalKind kind) {
    return scene.has(kind) && scene.signal(kind).axis < 0.0;
  };
  bool turned = false;  // r and ay are positive to the right
  if (steering_off && ay_off) {
    scene.find(
        "sign_r", "serious", {scene.signal(SignalKind::r).column},
        fmt::format("{} has the opposite sign to the steering angle (correlation {:.2f}) and "
                    "to ay (vx r with ay {:.2f})",
                    scene.name(SignalKind::r), with_r, with_ay),
        "ISO 8855: everything positive to the left; scale: -1 for r");
    flip(scene, SignalKind::r);
  } else if (ay_off) {
    const bool r_down = axis(SignalKind::r) && !axis(SignalKind::ay) && !(with_r > 0.5);
    scene.find("sign_ay", "serious", {scene.signal(SignalKind::ay).column},
               fmt::format("{} has the opposite sign to vx r (correlation {:.2f})",
                           scene.name(SignalKind::ay), with_ay),
               fmt::format("ISO 8855: everything positive to the left; scale: -1 for {}",
                           r_down ? "r" : "ay"));
    flip(scene, r_down ? SignalKind::r : SignalKind::ay);
  } else if (steering_off) {
    // One of the two sides is mirrored; the names, or sideslip, may tell which.
    turned = axis(SignalKind::r) || axis(SignalKind::ay) || with_vy < -0.5;
    const std::string both = scene.has(SignalKind::ay) ? "r and ay" : "r";
    std::string why;
    if (axis(SignalKind::r)) why = "; its name says that the axis points down";
    scene.find(
        "sign_steering", "serious",
        {scene.signal(SignalKind::steering).column, scene.signal(SignalKind::r).column},
        fmt::format("{} has the opposite sign to the steering angle {} (correlation "
                    "{:.2f}){}",
                    scene.name(SignalKind::r), scene.name(SignalKind::steering), with_r, why),
        turned ? "ISO 8855: everything positive to the left; scale: -1 for " + both
               : "ISO 8855: everything positive to the left; scale: -1 for the steering "
                 "angle, or for " +
                     both + " where these are positive to the right");
    if (turned) {
      flip(scene, SignalKind::r);
      flip(scene, SignalKind::ay);
    } else {
      flip(scene, SignalKind::steering);
    }
  }
  // ay - vx r turns its sign with r and ay.
  const double vy_after = turned ? -with_vy : with_vy;
  if (vy_after < -0.5 && !ay_off) {
    const SignalKind kind = scene.has(SignalKind::vy) ? SignalKind::vy : SignalKind::beta;
    scene.find(
        "sign_vy", "serious", {scene.signal(kind).column},
        fmt::format("{} goes against ay - vx r (correlation {:.2f})", scene.name(kind), vy_after),
        "ISO 8855: vy to the left is positive; scale: -1");
    flip(scene, kind);
  }
}

// --- A channel that freezes while another one that follows it moves ---

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
      const double moved = quantile_of(during, 0.95) - quantile_of(during, 0.05);
      if (moved < (0.4 + 2.0 / steps) * range) continue;
      frozen += scene.time[end - 1] - scene.time[i];
      if (std::isnan(begin)) begin = scene.time[i];
    }
    if (std::isnan(begin)) continue;
    named.insert(p.kind);
    scene.find("stuck_channel", "serious", {scene.signal(p.kind).column},
               fmt::format("{} stands still for {:.1f} s in all, from {:.6g} s, while {} moves",
                           scene.name(p.kind), frozen, begin, scene.name(p.with)),
               "leave these rows out with --range: the sensor or its bus was silent");
  }
}

// --- Excitation ---

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
    const double power = spectrum.S[static_cast<std::size_t>(k)](0, 0).real();
    const double hertz = spectrum.omega[k] / (2.0 * std::numbers::pi * scene.step);
    all += power;
    half_hertz += hertz > 0.5 ? power : 0.0;
    more += hertz > 1.5 ? power : 0.0;
  }
  out.above_half_hertz = half_hertz / all;
  out.above_1_5_hertz = more / all;
}

// Straight driving: what the sensors say there, for a second and more, is their offset.
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
    for (Index k = i; k < end; ++k) straight[static_cast<std::size_t>(k)] = true;
  }
  if (total < 2.0) return;
  for (VehicleSurvey::Signal& entry : scene.out.signals) {
    for (const SignalKind kind : {SignalKind::steering, SignalKind::r, SignalKind::ay}) {
      if (!scene.has(kind) || scene.signal(kind).column != entry.column) continue;
      std::vector<double> values;
      for (Index i = 0; i < r.size(); ++i) {
        const double x = scene.on[kind][i];
        if (straight[static_cast<std::size_t>(i)] && !std::isnan(x)) values.push_back(x);
      }
      entry.straight = quantile_of(std::move(values), 0.5) / unit_scale(scene.signal(kind));
    }
  }
}

// --- What a fit could tell (VEHICLE: identifiability) ---

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
    say("Cf, Cr", "weak", "no yaw rate: what the others can tell was not looked at");
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
      fmt::format("{:.2g} % of the steering's power lies above 0.5 Hz, {:.2g} % above 1.5 Hz",
                  100.0 * out.above_half_hertz, 100.0 * out.above_1_5_hertz);
  const std::string speeds =
      fmt::format("turning at {:.0f} to {:.0f} m/s (5 to 95 %)", out.speed[1], out.speed[3]);
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
    say("Cf, Cr", quick || gain_told || gain_weak ? "yes" : "weak",
        fmt::format("over mass, given the {}: sideslip tells the axles apart", ratio));
    say("Iz", quick ? "yes" : rather_quick ? "weak" : "no", frequencies);
  } else if (very_quick) {
    say("Cf, Cr", "weak",
        fmt::format("yaw rate without sideslip: only with m, a, b and the {} exact; {}", ratio,
                    frequencies));
    say("Iz", "weak", "with Cf and Cr only: yaw rate without sideslip");
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
    say(which.c_str(), "weak", speeds + ": a ratio above 2 tells it better");
  } else {
    say(which.c_str(), "no",
        speeds +
            (several_speeds ? fmt::format(", but only {} of it above 2 m/s^2", percent(strong))
                            : ": a ratio above 2, or a slow stretch, is needed") +
            "; a wrong one makes wrong stiffnesses fit as well");
  }
  say("a, b", slip ? "weak" : "no",
      slip ? "needs sideslip at several speeds; axle weights are better"
           : "needs sideslip, or axle weights");
  const double lesser = std::min(out.left, 1.0 - out.left);
  say("offsets", lesser > 0.2 || several_speeds ? "yes" : "no",
      fmt::format("steering offset, yaw bias, ay bias: {} of turning is to the left{}",
                  percent(out.left), several_speeds ? ", several speeds" : ""));
}

// --- The mapping proposed ---

void propose(const VehicleSignals& signals, Scene& scene) {
  struct Line {
    SignalKind kind;
    bool input;
  };
  const Line lines[] = {{SignalKind::steering, true}, {SignalKind::vx, true},
                        {SignalKind::r, false},       {SignalKind::vy, false},
                        {SignalKind::beta, false},    {SignalKind::ay, false}};
  for (const Line& line : lines) {
    SignalKind kind = line.kind;
    if (kind == SignalKind::vx && !scene.first.contains(kind)) kind = SignalKind::wheel_speed;
    if (!scene.first.contains(kind)) continue;
    const VehicleSignal& s = *scene.first.at(kind);
    const std::string name = line.kind == SignalKind::steering
                                 ? (s.at_wheel ? "steering_wheel_angle" : "road_wheel_angle")
                                 : to_string(line.kind);
    scene.out.mapping.push_back({line.input, name, s.column, s.unit, s.scale, s.offset, s.delay});
  }
  scene.out.time_column = signals.time_column;
  scene.out.time_unit = signals.time_unit;
  scene.out.least_speed = kSlowestUse;
}

void propose_delays(Scene& scene) {
  const auto relation = [&](std::string_view expected, std::string_view seen) {
    const auto& all = scene.out.relations;
    const auto hit = std::find_if(all.begin(), all.end(), [&](const VehicleSurvey::Relation& r) {
      return r.clock && r.expected == expected && r.seen == seen;
    });
    return hit == all.end() ? nullptr : &*hit;
  };
  const VehicleSurvey::Relation* steering = relation("steering", "r");
  const VehicleSurvey::Relation* wheels = relation("vx", "wheel speed");
  if (VehicleSurvey::Proposal* p = scene.proposal(SignalKind::steering); p && steering) {
    // r is late behind the steering: the steering is early.
    double late = -steering->lag;
    if (wheels && std::abs(wheels->lag + steering->lag) <
                      3.0 * std::hypot(wheels->lag_se, steering->lag_se)) {
      // Both come from one bus; how fast the car answers does not blur what its wheels say.
      const double w = 1.0 / (wheels->lag_se * wheels->lag_se);
      const double s = 1.0 / (steering->lag_se * steering->lag_se);
      late = (w * wheels->lag - s * steering->lag) / (w + s);
      scene.find(
          "one_clock", "note",
          {scene.signal(SignalKind::steering).column, scene.signal(SignalKind::wheel_speed).column},
          fmt::format("{} and {} lag alike: one clock, {:.2f} s {} for both",
                      scene.name(SignalKind::steering), scene.name(SignalKind::wheel_speed),
                      std::abs(late), late > 0.0 ? "late" : "early"),
          "");
    }
    p->delay += late;
  }
  if (const auto* ay = relation("vx r", "ay")) {
    if (VehicleSurvey::Proposal* p = scene.proposal(SignalKind::ay)) p->delay += ay->lag;
  }
  if (const auto* beta = relation("vy / vx", "beta")) {
    if (VehicleSurvey::Proposal* p = scene.proposal(SignalKind::beta)) p->delay += beta->lag;
  }
}

// Files keep their own time; the lags say how far apart these run.
void name_clocks(Scene& scene) {
  std::map<std::string, std::string> of_source;
  for (const auto& [kind, signal] : scene.first) {
    std::string& list = of_source[signal->source];
    list += (list.empty() ? "" : ", ") + signal->column;
  }
  if (of_source.size() < 2) return;
  std::string text =
      fmt::format("the signals come from {} files with clocks of their own:", of_source.size());
  for (const auto& [source, list] : of_source) {
    text += fmt::format("{} {} ({})", text.ends_with(':') ? "" : ";", source, list);
  }
  std::string lags;
  for (const VehicleSurvey::Relation& r : scene.out.relations) {
    if (!std::isfinite(r.lag)) continue;
    lags += fmt::format("{}{} after {} by {:.2f} +- {:.2f} s", lags.empty() ? "" : ", ", r.seen,
                        r.expected, r.lag, r.lag_se);
  }
  scene.find("several_clocks", "note", {}, text, lags);
}

}  // namespace

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

VehicleSignals vehicle_signals(const ModelFile& model, const Dataset& data) {
  VehicleSignals out;
  out.name = data.name;
  out.time_column = model.time.column;
  out.time_unit = model.time.unit;
  const auto take = [&](const std::vector<ChannelSource>& sources,
                        const std::vector<Channel>& channels, const Eigen::MatrixXd& values) {
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

VehicleSurvey survey(const VehicleSignals& signals) {
  Scene scene;
  scene.out.findings = signals.findings;
  if (signals.signals.empty() && scene.found("no_time")) {
    scene.out.verdicts = {{"Cf, Cr", "no", "without time there is no motion to compare"}};
    return scene.out;
  }
  const bool raster = make_raster(signals, scene);
  propose(signals, scene);
  if (!scene.first.contains(SignalKind::steering)) {
    scene.find("no_steering", "serious", {}, "no column looks like a steering angle",
               "name it in the model file; without it nothing can be identified");
  } else if (const VectorXd& x = scene.first.at(SignalKind::steering)->value;
             !(quantile_of(x, 0.0) < quantile_of(x, 1.0))) {
    scene.find("no_steering", "serious", {scene.signal(SignalKind::steering).column},
               fmt::format("the steering angle {} never changes", scene.name(SignalKind::steering)),
               "is it the right column? Else record a manoeuvre");
  }
  if (!scene.first.contains(SignalKind::r)) {
    const bool ay = scene.first.contains(SignalKind::ay);
    scene.find("no_yaw_rate", ay ? "warning" : "serious", {}, "no column looks like a yaw rate",
               "name it in the model file; without it signs, units and clocks are not compared");
  }
  const bool speed = scene.speed.size() > 0;
  if (!speed) {
    scene.find("no_speed", "serious", {}, "no column looks like a speed",
               "name it in the model file");
  }
  const auto driving = speed ? (scene.speed.array() > kSlowestTest).count() : Index{0};
  const bool moved = static_cast<double>(driving) * (raster ? scene.step : 0.0) >= 2.0;
  if (raster && speed) look_at_speed(scene);
  if (!raster || (speed && (!moved || driving < 40))) {
    scene.find("too_short", "serious", {},
               raster
                   ? fmt::format("{:.1f} s in {} rows above {} m/s",
                                 static_cast<double>(driving) * scene.step, driving, kSlowestTest)
                   : std::string("less than two rows"),
               "a manoeuvre takes some seconds, and the model a moving car; is a unit wrong?");
  } else if (speed && scene.has(SignalKind::r)) {
    check_swapped(scene);
    check_acceleration(scene);
    if (!scene.found("no_steering")) check_steering(scene);
    check_wheels(scene);
    check_sideslip(scene);
    check_signs_of(scene);
    check_stuck(scene);
    look_at_excitation(scene);
    look_at_straights(scene);
    propose_delays(scene);
    name_clocks(scene);
  }
  judge_identifiability(scene);
  const auto rank = [](const Warning& w) {
    return w.severity == "serious" ? 0 : w.severity == "warning" ? 1 : 2;
  };
  std::stable_sort(scene.out.findings.begin(), scene.out.findings.end(),
                   [&](const Warning& a, const Warning& b) { return rank(a) < rank(b); });
  return scene.out;
}

}  // namespace identikal
