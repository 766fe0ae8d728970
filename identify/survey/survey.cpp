#include "identify/survey/survey.h"

#include <algorithm>
#include <stdexcept>

#include <fmt/format.h>

#include "identify/survey/events.h"
#include "identify/survey/internal/excitation.h"
#include "identify/survey/internal/kinematics.h"
#include "identify/survey/internal/mapping.h"
#include "identify/survey/internal/signal_quality.h"

namespace identikal {
namespace {

void check_sizes(const VehicleSignals& signals) {
  for (const VehicleSignal& signal : signals.signals) {
    if (signal.time.size() == signal.value.size()) continue;
    throw std::invalid_argument(fmt::format("signal '{}' has {} times and {} values", signal.column,
                                            signal.time.size(), signal.value.size()));
  }
}

// Where the car spins or is held in a slide its kinematics say nothing of signs, units and clocks.
void leave_out_spins(surveying::Scene& scene) {
  if (!scene.has(SignalKind::steering) || !scene.has(SignalKind::r)) return;
  Eigen::VectorXd vy;
  if (scene.has(SignalKind::vy)) {
    vy = scene.on[SignalKind::vy];
  } else if (scene.has(SignalKind::beta)) {
    vy = scene.speed.array() * scene.on[SignalKind::beta].array().tan();
  }
  const SpinSignals signals{scene.time, scene.on[SignalKind::steering], scene.speed,
                            scene.on[SignalKind::r], vy};
  const std::vector<Spin> spins = find_spins(signals);
  const std::vector<Spin> slides = find_countersteering(signals, spins);
  for (const std::vector<Spin>* rows : {&spins, &slides}) {
    for (const Spin& each : *rows) scene.speed.segment(each.first, each.rows).setConstant(kNone);
  }
  append(scene.out.findings, check_spins(spins, scene.time, false));
  append(scene.out.findings, check_countersteering(slides, scene.time, false));
}

}  // namespace

VehicleSurvey survey(const VehicleSignals& signals) {
  using namespace surveying;  // NOLINT: its parts
  check_sizes(signals);
  Scene scene;
  scene.out.findings = signals.findings;
  scene.length = signals.length;
  if (signals.signals.empty() && scene.found(FindingCode::no_time)) {
    scene.out.identifiable = {{"Cf, Cr", "no", "without time there is no motion to compare"}};
    return scene.out;
  }
  const bool grid = make_sampling_grid(signals, scene);
  list_signals(signals, scene);
  propose_mapping(signals, scene);
  if (!scene.first.contains(SignalKind::steering)) {
    scene.add_finding(FindingCode::no_steering, Severity::serious, {},
                      "no column looks like a steering angle",
                      "name it in the model file; without it nothing can be identified");
  } else if (const Eigen::VectorXd& x = scene.first.at(SignalKind::steering)->value;
             !(quantile_of(x, 0.0) < quantile_of(x, 1.0))) {
    scene.add_finding(
        FindingCode::no_steering, Severity::serious, {scene.signal(SignalKind::steering).column},
        fmt::format("the steering angle {} never changes", scene.name(SignalKind::steering)),
        "is it the right column? Else record a manoeuvre");
  }
  if (!scene.first.contains(SignalKind::r)) {
    const bool ay = scene.first.contains(SignalKind::ay);
    scene.add_finding(
        FindingCode::no_yaw_rate, ay ? Severity::warning : Severity::serious, {},
        "no column looks like a yaw rate",
        "name it in the model file; without it signs, units and clocks are not compared");
  }
  const bool speed = scene.speed.size() > 0;
  if (!speed) {
    scene.add_finding(FindingCode::no_speed, Severity::serious, {}, "no column looks like a speed",
                      "name it in the model file");
  }
  const auto driving = speed ? (scene.speed.array() > kSlowestTest).count() : Eigen::Index{0};
  const bool moved = static_cast<double>(driving) * (grid ? scene.step : 0.0) >= 2.0;
  if (grid && speed) measure_speed(scene);
  if (grid && speed) leave_out_spins(scene);
  if (!grid || (speed && (!moved || driving < 40))) {
    scene.add_finding(
        FindingCode::too_short, Severity::serious, {},
        grid ? fmt::format("{:.1f} s in {} rows above {} m/s",
                           static_cast<double>(driving) * scene.step, driving, kSlowestTest)
             : std::string("less than two rows"),
        "a manoeuvre takes some seconds, and the model a moving car; is a unit wrong?");
  } else if (speed && scene.has(SignalKind::r)) {
    check_kinematics(scene);
    check_stuck(scene);
    measure_excitation(scene);
    measure_straight_running(scene);
    propose_delays(scene);
    report_clocks(scene);
  }
  assess_identifiability(scene);
  const auto rank = [](const Finding& w) {
    return w.severity == Severity::serious ? 0 : w.severity == Severity::warning ? 1 : 2;
  };
  std::stable_sort(scene.out.findings.begin(), scene.out.findings.end(),
                   [&](const Finding& a, const Finding& b) { return rank(a) < rank(b); });
  return scene.out;
}

}  // namespace identikal
