#include "identify/survey/internal/kinematics.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "lib/base/constants.h"
#include "lib/base/interpolation.h"
#include "lib/statistics/clock_offset.h"

namespace identikal::surveying {

using Eigen::Index;
using Eigen::VectorXd;
namespace {

constexpr double kTypicalSpeed = 25.0;  // [m/s]: characteristic speed of a usual car
constexpr double kFarLag = 5.0;         // [s]

// What a first-order lag makes of x on a uniform sampling grid; restarts after a gap.
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

// What vx r / ay is off by where units were mistaken.
struct UnitGuess {
  double off;
  const char* words;
};
constexpr UnitGuess kUnitGuesses[] = {
    {kStandardGravity, "ay is in g, taken as m/s^2"},
    {1.0 / kStandardGravity, "ay is in m/s^2, taken as g"},
    {1.0 / kDegree, "r is in deg/s, taken as rad/s"},
    {kDegree, "r is in rad/s, taken as deg/s"},
    {3.6, "vx is in km/h, taken as m/s"},
    {1.0 / 3.6, "vx is in m/s, taken as km/h"},
    {kStandardGravity / kDegree, "r is in deg/s and ay in g, taken as rad/s and m/s^2"},
    {3.6 / kDegree, "vx is in km/h and r in deg/s, taken as m/s and rad/s"},
    {3.6 * kStandardGravity, "vx is in km/h and ay in g, taken as m/s and m/s^2"},
    {3.6 * kStandardGravity / kDegree, "vx is in km/h, r in deg/s and ay in g, taken as SI"},
};

bool near_one(double ratio) { return ratio > 0.6 && ratio < 1.6; }

void check_swapped(Scene& scene) {
  if (scene.has(SignalKind::vx) && scene.has(SignalKind::vy)) {
    const double vx = quantile_of(scene.on[SignalKind::vx].cwiseAbs(), 0.9);
    const double vy = quantile_of(scene.on[SignalKind::vy].cwiseAbs(), 0.9);
    if (vy > vx && vy > 1.0) {
      scene.add_finding(
          FindingCode::swapped_channels, Severity::serious,
          {scene.signal(SignalKind::vx).column, scene.signal(SignalKind::vy).column},
          fmt::format("{} as vx is mostly smaller than {} as vy ({} against {} m/s): a car drives "
                      "forward, not sideways",
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
  const PairedCorrelation straight = fits(r, ay);
  if (scene.has(SignalKind::vy)) {
    const VehicleSignal& vy = scene.signal(SignalKind::vy);
    for (const double as_r : {1.0, kDegree}) {
      const PairedCorrelation crossed =
          fits(scene.smooth[SignalKind::vy] / unit_scale(vy) * as_r, ay);
      const bool better = std::abs(crossed.correlation) > 0.9 &&
                          !(std::abs(straight.correlation) > std::abs(crossed.correlation) - 0.05);
      if (!better || !(crossed.slope > 0.75 && crossed.slope < 1.33)) continue;
      scene.add_finding(
          FindingCode::swapped_channels, Severity::serious,
          {scene.signal(SignalKind::r).column, vy.column},
          fmt::format("{} behaves like r, and {} does not: {} = vx {} then holds within {}",
                      scene.name(SignalKind::vy), scene.name(SignalKind::r),
                      scene.name(SignalKind::ay), scene.name(SignalKind::vy),
                      percent(std::abs(crossed.slope - 1.0))),
          "exchange the two columns");
      return;
    }
  }
  if (near_one(straight.slope) && std::abs(straight.correlation) > 0.7) return;
  for (const UnitGuess& guess : kUnitGuesses) {
    const bool fitting = straight.slope * guess.off > 0.8 && straight.slope * guess.off < 1.25;
    if (fitting && std::abs(straight.correlation) > 0.9) return;  // units explain it
  }
  const double raw_r = unit_scale(scene.signal(SignalKind::r));
  const double raw_ay = unit_scale(scene.signal(SignalKind::ay));
  for (const double as_r : {1.0, kDegree}) {
    for (const double as_ay : {1.0, kStandardGravity}) {
      const PairedCorrelation crossed = fits(ay / raw_ay * as_r, r / raw_r * as_ay);
      const bool better = std::abs(crossed.correlation) > 0.8 &&
                          std::abs(crossed.correlation) >= std::abs(straight.correlation) - 0.02;
      if (!better || !(crossed.slope > 0.75 && crossed.slope < 1.33)) continue;
      scene.add_finding(
          FindingCode::swapped_channels, Severity::serious,
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
void check_clock(Scene& scene, VehicleSurvey::Relation& relation, double least, SignalKind late) {
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
    scene.add_finding(FindingCode::clock_unclear, Severity::note, {scene.signal(late).column},
                      where,
                      "something that swings regularly looks alike a period later: compare by eye");
    return;
  }
  scene.add_finding(
      FindingCode::clock_offset, Severity::serious, {scene.signal(late).column}, where,
      "shift it by 'delay' in the model file: a search that starts without shift stays wrong");
}

// Means over whole blocks of `length` seconds; NaN where a sample of the block is missing.
VectorXd block_means(const Scene& scene, const VectorXd& x, double length) {
  const auto size = std::max<Index>(1, std::lround(length / scene.step));
  VectorXd out(x.size() / size);
  for (Index k = 0; k < out.size(); ++k) out[k] = x.segment(k * size, size).mean();
  return out;
}

// Over seconds dvy/dt averages out, and ay is vx r. What is left is the gain of a sensor, or the
// body's roll, which adds g times its angle.
void check_gain_of_acceleration(Scene& scene, const VectorXd& expected, const VectorXd& seen) {
  constexpr double kBlock = 2.0, kLeast = 1.0;  // [s], [m/s^2]
  constexpr Index kFewest = 10;
  VectorXd x = block_means(scene, expected, kBlock), y = block_means(scene, seen, kBlock);
  for (Index k = 0; k < x.size(); ++k) {
    if (!(std::abs(x[k]) > kLeast)) x[k] = kNaN;
  }
  const PairedCorrelation pair = compare_pair(x, y);
  if (pair.count < kFewest || !(pair.correlation > 0.98)) return;
  const double scatter = 1.0 - pair.correlation * pair.correlation;
  const double se = pair.slope * std::sqrt(scatter / static_cast<double>(pair.count - 2));
  if (!(std::abs(pair.slope - 1.0) > std::max(0.05, 4.0 * se)) || !near_one(pair.slope)) return;
  const double roll = (pair.slope - 1.0) / kDegree;  // deg per g
  scene.add_finding(
      FindingCode::gain_ay, Severity::warning, {scene.signal(SignalKind::ay).column},
      fmt::format("over {:g} s, {} is {:.2f} +- {:.2f} times {} times {}", kBlock,
                  scene.name(SignalKind::ay), pair.slope, se, scene.speed_name,
                  scene.name(SignalKind::r)),
      fmt::format("{}a gain of ay, of the speed or of the yaw rate: the model has none of these",
                  roll > 0.0 && roll < 12.0
                      ? fmt::format("a body that leans {:.1f} deg per g, or ", roll)
                      : ""));
}

// x less the share that goes with `other`, by least squares over the samples that `where` has too.
VectorXd without(const VectorXd& x, const VectorXd& other, const VectorXd& where) {
  VectorXd out = x;
  for (Index i = 0; i < out.size(); ++i) {
    if (std::isnan(where[i])) out[i] = kNaN;
  }
  const PairedCorrelation pair = compare_pair(other, out);
  if (std::isnan(pair.correlation)) return out;
  return out - pair.correlation * pair.slope * other;
}

// dvy/dt on the sampling grid, over the length of the smoothing; empty when neither vy nor beta is measured.
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
  if (!scene.found(FindingCode::swapped_channels)) {
    check_clock(scene, relation, least, SignalKind::ay);
    check_gain_of_acceleration(scene, expected, seen);
    const double ratio = 1.0 / relation.slope;  // vx r over ay
    if (std::abs(relation.correlation) > 0.7 && !near_one(relation.slope)) {
      std::string guess;
      for (const UnitGuess& unit : kUnitGuesses) {
        if (std::abs(std::log(ratio / unit.off)) > std::log(1.3)) continue;
        guess += (guess.empty() ? "" : ", or ") + std::string(unit.words);
      }
      scene.add_finding(FindingCode::units_ay, Severity::serious,
                        {scene.signal(SignalKind::ay).column, scene.signal(SignalKind::r).column},
                        fmt::format("{} is {} times {} times {}, and should be about once that",
                                    scene.name(SignalKind::ay), shown(relation.slope),
                                    scene.speed_name, scene.name(SignalKind::r)),
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
  const PairedCorrelation low = compare_pair(slow, y);
  out.length = 1.0 / low.slope;
  return out;
}

// What vx delta / r may be: of model cars and of trucks where the model file does not say it.
struct Lengths {
  double least, most;
  bool hold(double length) const { return length > least && length < most; }
};

Lengths lengths_of(const Scene& scene, bool at_wheel) {
  // Understeer is no more than guessed, and a mistaken unit or ratio is off by ten or more.
  constexpr double kMistaken = 5.0;
  if (scene.length > 0.0) return {scene.length / kMistaken, kMistaken * scene.length};
  return at_wheel ? Lengths{12.0, 150.0} : Lengths{0.1, 12.0};
}

void check_steering_length(Scene& scene, double found) {
  const bool at_wheel = scene.signal(SignalKind::steering).at_wheel;
  if (!std::isfinite(found) || lengths_of(scene, at_wheel).hold(found)) return;
  struct Reading {
    double factor;
    bool wheel;
    const char* words;
  };
  const Reading readings[] = {{1.0, false, "an angle of the road wheels"},
                              {1.0, true, "an angle of the steering wheel"},
                              {kDegree, true, "a steering-wheel angle in deg, taken as rad"},
                              {kDegree, false, "a road-wheel angle in deg, taken as rad"},
                              {1.0 / kDegree, true, "a steering-wheel angle in rad, taken as deg"},
                              {1.0 / kDegree, false, "a road-wheel angle in rad, taken as deg"}};
  std::string guess;
  for (const Reading& reading : readings) {
    // A known length is that of the angle as it is mapped.
    const Lengths usual = scene.length > 0.0 && reading.wheel == at_wheel
                              ? lengths_of(scene, at_wheel)
                          : reading.wheel ? Lengths{20.0, 150.0}
                                          : Lengths{0.15, 8.0};
    if (!usual.hold(found * reading.factor)) continue;
    guess += (guess.empty() ? "is it " : ", or ") + std::string(reading.words);
  }
  const std::string expected =
      scene.length > 0.0
          ? fmt::format("the model file has {} m", shown(scene.length))
          : std::string(
                "wheelbase times steering ratio of a vehicle is 20 to 150 m, its wheelbase "
                "0.15 to 8 m");
  scene.add_finding(FindingCode::units_steering, Severity::serious,
                    {scene.signal(SignalKind::steering).column},
                    fmt::format("vx delta / r is {} m; {}", shown(found), expected),
                    guess.empty() ? "check the units of steering, vx and r" : guess + "?");
}

void check_steering(Scene& scene) {
  if (!scene.has(SignalKind::steering) || !scene.has(SignalKind::r)) return;
  const VectorXd steering = while_driving(scene, scene.on[SignalKind::steering], kSlowestTest);
  const double low = quantile_of(steering, 0.0), high = quantile_of(steering, 1.0);
  const bool at_wheel = scene.signal(SignalKind::steering).at_wheel;
  if (!(high - low > (at_wheel ? 0.02 : 0.001))) {
    scene.add_finding(FindingCode::no_steering, Severity::serious,
                      {scene.signal(SignalKind::steering).column},
                      fmt::format("the steering angle stays within {} rad while the car drives",
                                  std::isnan(high - low) ? "0" : shown(high - low)),
                      "is it the right column, and its unit right? Else record a manoeuvre");
    return;
  }
  Steered steered = compare_steering(scene);
  VehicleSurvey::Relation& relation = steered.relation;
  // Files of their own have clocks of their own: there any lag that is certain is one of clocks.
  const bool one_file =
      scene.signal(SignalKind::steering).source == scene.signal(SignalKind::r).source;
  check_clock(scene, relation, one_file ? 0.15 : 0.0, SignalKind::r);
  if (relation.clock) {
    // The kinematics between yaw rate, ay and speed hold: it is the steering that comes early.
    Finding& w = scene.out.findings.back();
    w.about = {scene.signal(SignalKind::steering).column};
    w.text = fmt::format(
        "{} is {:.2f} +- {:.2f} s {} than the yaw rate indicates (correlation {:.2f} there)",
        scene.name(SignalKind::steering), std::abs(relation.lag), relation.lag_se,
        relation.lag > 0.0 ? "earlier" : "later", relation.correlation);
  }
  if (std::abs(relation.correlation) > 0.6) check_steering_length(scene, steered.length);
  scene.out.relations.push_back(relation);
}

// --- Wheels against vx, sideslip ---

void check_wheels(Scene& scene) {
  if (!scene.has(SignalKind::vx) || !scene.has(SignalKind::wheel_speed)) return;
  VehicleSurvey::Relation relation =
      relate(scene.time, scene.smooth[SignalKind::vx], scene.smooth[SignalKind::wheel_speed], "vx",
             "wheel speed");
  check_clock(scene, relation, 0.08, SignalKind::wheel_speed);
  scene.out.relations.push_back(relation);
}

// One device computes beta from the vy and vx that it writes: the same noise, so one measurement.
void check_one_measurement(Scene& scene) {
  const VectorXd& vx = scene.on[SignalKind::vx];
  const VectorXd& vy = scene.on[SignalKind::vy];
  VectorXd angle(vx.size());
  for (Index k = 0; k < angle.size(); ++k) angle[k] = std::atan2(vy[k], vx[k]);
  angle = while_driving(scene, angle, scene.out.least_speed);
  const VectorXd beta = while_driving(scene, scene.on[SignalKind::beta], scene.out.least_speed);
  const PairedCorrelation pair = compare_pair(angle, beta);
  if (!(pair.correlation > 0.9999) || std::abs(pair.slope - 1.0) > 0.02) return;
  scene.add_finding(FindingCode::one_measurement, Severity::note,
                    {scene.signal(SignalKind::beta).column, scene.signal(SignalKind::vy).column},
                    fmt::format("{} is the angle of {} and {}, sample by sample: one measurement",
                                scene.name(SignalKind::beta), scene.name(SignalKind::vy),
                                scene.name(SignalKind::vx)),
                    "one of the two as output; both would count the same noise twice");
  std::erase_if(scene.out.mapping,
                [](const VehicleSurvey::Proposal& p) { return p.name == "beta"; });
}

void check_sideslip(Scene& scene) {
  if (scene.has(SignalKind::vy) && scene.has(SignalKind::beta) && scene.has(SignalKind::vx)) {
    check_one_measurement(scene);
  }
  if (scene.has(SignalKind::vy) && scene.has(SignalKind::beta)) {
    const VectorXd angle = while_driving(
        scene, scene.smooth[SignalKind::vy].cwiseQuotient(scene.speed), scene.out.least_speed);
    const VectorXd beta =
        while_driving(scene, scene.smooth[SignalKind::beta], scene.out.least_speed);
    VehicleSurvey::Relation relation = relate(scene.time, angle, beta, "vy / vx", "beta");
    check_clock(scene, relation, 0.08, SignalKind::beta);
    if (relation.correlation < -0.7) {
      scene.add_finding(
          FindingCode::sign_vy, Severity::serious,
          {scene.signal(SignalKind::vy).column, scene.signal(SignalKind::beta).column},
          fmt::format("{} and {} have opposite signs", scene.name(SignalKind::vy),
                      scene.name(SignalKind::beta)),
          "ISO 8855: vy to the left is positive, beta = atan(vy/vx)");
    }
    scene.out.relations.push_back(relation);
  }
  const VectorXd rate = lateral_rate(scene);
  if (rate.size() == 0 || !scene.has(SignalKind::r) || !scene.has(SignalKind::ay)) return;
  // A body that leans adds g times its angle to ay, in proportion to ay: that says nothing of vy.
  const VectorXd turning = while_driving(
      scene, scene.speed.cwiseProduct(scene.smooth[SignalKind::r]), scene.out.least_speed);
  const VectorXd left_over = scene.smooth[SignalKind::ay] - turning;
  VehicleSurvey::Relation relation;
  relation.expected = "ay - vx r";
  relation.seen = "dvy/dt";
  const PairedCorrelation pair =
      compare_pair(without(left_over, turning, rate), without(rate, turning, left_over));
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

const char* const kToTheLeft = "ISO 8855: everything positive to the left; ";

// The other sign for a signal: a scale of -1, or none where the model file has one.
std::string other_sign(const Scene& scene, SignalKind kind, const std::string& name) {
  const bool turned = scene.has(kind) && scene.signal(kind).scale < 0.0;
  return turned ? "leave out the scale: -1 of " + name : "scale: -1 for " + name;
}

// Which side does the model file mirror already: r (-1), the steering (1), or neither or both (0)?
int mirrored_side(const Scene& scene) {
  const bool r = scene.signal(SignalKind::r).scale < 0.0;
  const bool steering = scene.signal(SignalKind::steering).scale < 0.0;
  return static_cast<int>(steering) - static_cast<int>(r);
}

// The steering and the yaw rate have opposite signs: one of the two sides is mirrored. What the
// model file turns already, the names, or sideslip, may show which.
// @return whether it is r, with ay, which is positive to the right
bool report_opposite_steering(Scene& scene, double with_r, bool axis_down, double with_vy) {
  const int mirrored = mirrored_side(scene);
  const bool r_turned = scene.signal(SignalKind::r).axis < 0.0;
  const bool by_sideslip = std::abs(with_vy) > 0.5;
  const bool turned = axis_down || (by_sideslip ? with_vy < 0.0 : mirrored < 0);
  const bool has_ay = scene.has(SignalKind::ay);
  const std::string both = has_ay ? "r and ay" : "r";
  const std::string of_steering = other_sign(scene, SignalKind::steering, "the steering angle");
  std::string of_r = other_sign(scene, SignalKind::r, "r");
  if (has_ay) of_r += ", " + other_sign(scene, SignalKind::ay, "ay");
  scene.add_finding(
      FindingCode::sign_steering, Severity::serious,
      {scene.signal(SignalKind::steering).column, scene.signal(SignalKind::r).column},
      fmt::format("{} has the opposite sign to the steering angle {} (correlation {:.2f}){}",
                  scene.name(SignalKind::r), scene.name(SignalKind::steering), with_r,
                  r_turned ? "; its name says that the axis points down" : ""),
      kToTheLeft + (turned         ? of_r
                    : mirrored > 0 ? of_steering
                                   : of_steering + ", or for " + both +
                                         " where these are positive to the right"));
  if (turned) {
    flip(scene, SignalKind::r);
    flip(scene, SignalKind::ay);
  } else {
    flip(scene, SignalKind::steering);
  }
  return turned;
}

void check_signs_of(Scene& scene) {
  if (scene.found(FindingCode::swapped_channels)) return;
  const double with_r = correlation_of(scene, "steering"), with_ay = correlation_of(scene, "vx r");
  const double with_vy = correlation_of(scene, "ay - vx r");
  const bool steering_off = with_r < -0.5, ay_off = with_ay < -0.5;
  const auto axis = [&](SignalKind kind) {
    return scene.has(kind) && scene.signal(kind).axis < 0.0;
  };
  bool turned = false;  // r and ay are positive to the right
  if (steering_off && ay_off) {
    scene.add_finding(FindingCode::sign_r, Severity::serious, {scene.signal(SignalKind::r).column},
                      fmt::format("{} has the opposite sign to the steering angle (correlation "
                                  "{:.2f}) and to ay (vx r with ay {:.2f})",
                                  scene.name(SignalKind::r), with_r, with_ay),
                      kToTheLeft + other_sign(scene, SignalKind::r, "r"));
    flip(scene, SignalKind::r);
  } else if (ay_off) {
    const bool r_down = axis(SignalKind::r) && !axis(SignalKind::ay) && !(with_r > 0.5);
    scene.add_finding(FindingCode::sign_ay, Severity::serious,
                      {scene.signal(SignalKind::ay).column},
                      fmt::format("{} has the opposite sign to vx r (correlation {:.2f})",
                                  scene.name(SignalKind::ay), with_ay),
                      kToTheLeft + (r_down ? other_sign(scene, SignalKind::r, "r")
                                           : other_sign(scene, SignalKind::ay, "ay")));
    flip(scene, r_down ? SignalKind::r : SignalKind::ay);
  } else if (steering_off) {
    turned = report_opposite_steering(scene, with_r, axis(SignalKind::r) || axis(SignalKind::ay),
                                      with_vy);
  }
  // ay - vx r turns its sign with r and ay.
  const double vy_after = turned ? -with_vy : with_vy;
  if (vy_after < -0.5 && !ay_off) {
    const SignalKind kind = scene.has(SignalKind::vy) ? SignalKind::vy : SignalKind::beta;
    scene.add_finding(
        FindingCode::sign_vy, Severity::serious, {scene.signal(kind).column},
        fmt::format("{} has the opposite sign to ay - vx r (correlation {:.2f})", scene.name(kind),
                    vy_after),
        "ISO 8855: vy to the left is positive; " + other_sign(scene, kind, to_string(kind)));
    flip(scene, kind);
  }
}

}  // namespace

void check_kinematics(Scene& scene) {
  check_swapped(scene);
  check_acceleration(scene);
  if (!scene.found(FindingCode::no_steering)) check_steering(scene);
  check_wheels(scene);
  check_sideslip(scene);
  check_signs_of(scene);
}

}  // namespace identikal::surveying
