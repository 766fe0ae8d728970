#include "identify/survey/internal/mapping.h"

#include <algorithm>
#include <cmath>
#include <map>

#include <fmt/format.h>

namespace identikal::surveying {

void propose_mapping(const VehicleSignals& signals, Scene& scene) {
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
    scene.out.mapping.push_back(
        {line.input ? "inputs" : "outputs", name, s.column, s.unit, s.scale, s.offset, s.delay});
  }
  scene.out.time_column = signals.time_column;
  scene.out.time_unit = signals.time_unit;
  scene.out.restarts = signals.restarts;
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
      // Both come from one bus; the wheels' lag does not depend on how fast the car responds.
      const double w = 1.0 / (wheels->lag_se * wheels->lag_se);
      const double s = 1.0 / (steering->lag_se * steering->lag_se);
      late = (w * wheels->lag - s * steering->lag) / (w + s);
      scene.add_finding(
          FindingCode::one_clock, Severity::note,
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

void report_clocks(Scene& scene) {
  std::map<std::string, std::string> of_source;
  for (const auto& [kind, signal] : scene.first) {
    std::string& list = of_source[signal->source];
    list += (list.empty() ? "" : ", ") + signal->column;
  }
  if (of_source.size() < 2) return;
  std::string text =
      fmt::format("the signals come from {} files with separate clocks:", of_source.size());
  for (const auto& [source, list] : of_source) {
    text += fmt::format("{} {} ({})", text.ends_with(':') ? "" : ";", source, list);
  }
  std::string lags;
  for (const VehicleSurvey::Relation& r : scene.out.relations) {
    if (!std::isfinite(r.lag)) continue;
    lags += fmt::format("{}{} after {} by {:.2f} +- {:.2f} s", lags.empty() ? "" : ", ", r.seen,
                        r.expected, r.lag, r.lag_se);
  }
  scene.add_finding(FindingCode::several_clocks, Severity::note, {}, text, lags);
}

}  // namespace identikal::surveying
