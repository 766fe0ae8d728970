#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "identify/handling/internal/carried_errors.h"
#include "identify/handling/internal/lane_change_figures.h"
#include "identify/handling/internal/sections.h"
#include "lib/base/constants.h"

namespace identikal {
namespace {

using Value = HandlingSheet::Value;
using Section = HandlingSheet::Section;

struct PeakFigure {
  const char* name;
  const char* unit;
  double per_si;
  Value LaneChangeFigures::*of;
};
constexpr std::array<PeakFigure, 5> kPeaks{
    {{"peak of ay", "m/s^2", 1.0, &LaneChangeFigures::ay},
     {"peak of r", "deg/s", kDegreesPerRadian, &LaneChangeFigures::r},
     {"peak of beta", "deg", kDegreesPerRadian, &LaneChangeFigures::beta},
     {"peak of the steering angle", "deg", kDegreesPerRadian, &LaneChangeFigures::steering},
     {"peak of the steering rate", "deg/s", kDegreesPerRadian, &LaneChangeFigures::steering_rate}}};
constexpr std::size_t kOutputs = 3;  // the first ones; the others are inputs of the model

void add_figures(const KnownVehicle& car, const HandlingLog& log, const LaneChange& change,
                 Section& out) {
  const VehicleRun run = around(log.run, {{change.first, change.rows}});
  const std::vector<Value> model =
      with_carried_errors(car, [&](const VehicleParameters<double>& p) {
        const LaneChangeFigures figures =
            lane_change_figures(simulated_signals(run, car.curve, p), change);
        Eigen::VectorXd values(kOutputs);
        for (std::size_t i = 0; i < kOutputs; ++i) values[i] = (figures.*kPeaks[i].of).value;
        return values;
      });
  const Value input = blank("It is an input of the model.");
  out.figures.push_back({"entry speed", "km/h",
                         in_units(of_log(change.entry_speed, change.entry_speed_se), 3.6), input});
  const LaneChangeFigures measured = lane_change_figures(log.signals, change);
  for (std::size_t i = 0; i < kPeaks.size(); ++i) {
    const PeakFigure& peak = kPeaks[i];
    Value side = measured.*peak.of;
    if (std::isfinite(side.value)) side = of_log(side.value, side.se);
    out.figures.push_back({peak.name, peak.unit, in_units(side, peak.per_si),
                           i < kOutputs ? in_units(model[i], peak.per_si) : input});
  }
}

}  // namespace

void add_lane_change_section(const KnownVehicle& car, const std::optional<HandlingLog>& log,
                             HandlingSheet& sheet) {
  Section out{"ISO 3888", "double lane change", {}, {}};
  std::vector<LaneChange> found;
  if (log) found = lane_changes_in(log->signals);
  if (!found.empty()) {
    const LaneChange& fastest = *std::max_element(
        found.begin(), found.end(),
        [](const LaneChange& a, const LaneChange& b) { return a.entry_speed < b.entry_speed; });
    add_figures(car, *log, fastest, out);
    out.remarks.push_back(fmt::format(
        "{}, {:.2g} m to the side, from {:.4g} s on; the model is simulated with its steering and "
        "speed.",
        found.size() == 1 ? std::string("One lane change and back is in the log")
                          : fmt::format("The fastest of {} lane changes in the log", found.size()),
        fastest.aside, log->signals.time[fastest.first]));
  } else if (log && log->run.find(VehicleQuantity::r) < 0) {
    out.remarks.push_back("The log has no yaw rate, by which a lane change is found.");
  } else {
    out.remarks.push_back(
        log ? "The log holds no lane change and back: none that leads 2 to 6 m to the side within "
              "12 s, with more than 2 m/s^2, and returns."
            : kNoLog);
  }
  sheet.sections.push_back(std::move(out));
}

}  // namespace identikal
