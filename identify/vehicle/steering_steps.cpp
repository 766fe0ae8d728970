#include "identify/vehicle/steering_steps.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <fmt/format.h>

#include "identify/vehicle/output_error.h"
#include "lib/base/constants.h"
#include "lib/data/units.h"

namespace identikal {
namespace {

using Eigen::Index;

constexpr double kLeastShareOfMotion = 0.003;  // of the angle's motion
constexpr double kSerious = 0.05, kWorthTelling = 0.02;

double rms_of_motion(const VehicleRun& run, const Eigen::VectorXd& x) {
  double sum = 0.0, squares = 0.0, count = 0.0;
  for (const VehicleRun::Segment& s : run.segments) {
    const auto part = x.segment(s.first, s.rows);
    sum += part.sum();
    squares += part.squaredNorm();
    count += static_cast<double>(s.rows);
  }
  return std::sqrt(std::max(0.0, squares / count - std::pow(sum / count, 2)));
}

/// The same run with its steering bridged in every segment.
VehicleRun bridged(const VehicleRun& run, double step) {
  VehicleRun out = run;
  for (const VehicleRun::Segment& s : run.segments) {
    out.steering.segment(s.first, s.rows) = bridged_steps(
        run.time.segment(s.first, s.rows), run.steering.segment(s.first, s.rows), step);
  }
  return out;
}

/// Where the angle passes from one level to the next, and how fast.
struct Crossing {
  double time, value, slope = 0.0;
};

/// With the ends of the recording. Between two crossings of one boundary the angle turns: it goes in
/// as fast as it came.
std::vector<Crossing> crossings_of(const Eigen::VectorXd& time, const Eigen::VectorXd& x,
                                   double step) {
  const Index N = x.size();
  std::vector<Crossing> out{{time[0], x[0]}};
  for (Index k = 0; k + 1 < N; ++k) {
    if (std::abs(x[k + 1] - x[k]) < 0.5 * step) continue;
    out.push_back({0.5 * (time[k] + time[k + 1]), 0.5 * (x[k] + x[k + 1])});
  }
  out.push_back({time[N - 1], x[N - 1]});
  for (std::size_t i = 1; i + 1 < out.size(); ++i) {
    const double before = out[i].time - out[i - 1].time, after = out[i + 1].time - out[i].time;
    const double in = (out[i].value - out[i - 1].value) / before,
                 away = (out[i + 1].value - out[i].value) / after;
    const bool turns_before = std::abs(in * before) < 0.25 * step,
               turns_after = std::abs(away * after) < 0.25 * step;
    if (turns_before || turns_after) {
      out[i].slope = turns_before && turns_after ? 0.0 : turns_before ? away : in;
    } else {
      out[i].slope = (in * after + away * before) / (before + after);
    }
  }
  return out;
}

bool is_wanted(VehicleParameter p) { return p == kCf || p == kCr || p == kYawInertia; }

}  // namespace

double step_of(const Eigen::VectorXd& x) {
  std::vector<double> values;
  for (const double value : x) {
    if (std::isfinite(value)) values.push_back(value);
  }
  std::sort(values.begin(), values.end());
  if (values.size() < 8) return 0.0;
  const double rounding = 1e-9 * std::max(std::abs(values.front()), std::abs(values.back()));
  std::vector<double> differences;
  for (std::size_t i = 1; i < values.size(); ++i) {
    const double difference = values[i] - values[i - 1];
    if (difference > rounding) differences.push_back(difference);
  }
  // Values that hardly ever repeat are not those of steps.
  if (differences.size() < 2 || 4 * differences.size() > values.size()) return 0.0;
  const double step = *std::min_element(differences.begin(), differences.end());
  for (const double difference : differences) {
    const double steps = difference / step;
    if (std::abs(steps - std::round(steps)) > 0.05 * std::max(1.0, std::round(steps))) return 0.0;
  }
  return step;
}

Eigen::VectorXd bridged_steps(const Eigen::VectorXd& time, const Eigen::VectorXd& x, double step) {
  const std::vector<Crossing> crossings = crossings_of(time, x, step);
  Eigen::VectorXd out = x;
  std::size_t next = 1;
  for (Index k = 0; k < x.size(); ++k) {
    while (next + 1 < crossings.size() && crossings[next].time < time[k]) ++next;
    const Crossing &from = crossings[next - 1], &to = crossings[next];
    const double length = to.time - from.time, s = (time[k] - from.time) / length;
    const double t = 1.0 - s;
    const double value = t * t * (1.0 + 2.0 * s) * from.value + s * s * (1.0 + 2.0 * t) * to.value +
                         s * t * length * (t * from.slope - s * to.slope);
    out[k] = std::clamp(value, x[k] - 0.5 * step, x[k] + 0.5 * step);
  }
  return out;
}

Findings check_steering_steps(const Model& model, const VehicleSearch& found,
                              const VehicleEstimate& estimate) {
  const VehicleRun& run = *found.problem.run;
  const VehicleUnknowns& unknowns = found.problem.unknowns;
  if (as_vehicle(model).steering_steps > 0.0 || found.problem.prediction ||
      std::none_of(unknowns.free.begin(), unknowns.free.end(), is_wanted)) {
    return {};
  }
  const double step = step_of(run.steering);
  if (!(step > 0.0)) return {};
  const double share = step / std::sqrt(12.0) / rms_of_motion(run, run.steering);
  if (!(share > kLeastShareOfMotion)) return {};
  const VehicleRun smooth = bridged(run, step);
  VehicleProblem problem = make_vehicle_problem(smooth, unknowns, found.problem.demand);
  problem.robust = found.problem.robust;
  const VehicleOptimum there = maximise_likelihood(problem, found.best.z, SolverOptions{});
  std::string changes;
  bool serious = false, worth_telling = false;
  for (std::size_t i = 0; i < unknowns.free.size(); ++i) {
    if (!is_wanted(unknowns.free[i])) continue;
    const EstimatedParameter& p = estimate.parameters[unknowns.position[i]];
    const auto n = static_cast<Index>(i);
    const double by = there.z[n] / found.best.z[n] - 1.0, se = std::abs(p.se / p.value);
    serious = serious || (std::abs(by) > kSerious && !(std::abs(by) < se));
    worth_telling = worth_telling || std::abs(by) > kWorthTelling;
    changes += fmt::format("{}{} {:+.0f} %", changes.empty() ? "" : ", ", p.name, 100.0 * by);
  }
  if (!worth_telling && !serious) return {};
  const ChannelSource& channel = model.inputs[0];
  const std::string unit = channel.unit.empty() ? "rad" : channel.unit;
  const double shown = step / unit_or_dimensionless(unit).scale / std::abs(channel.scale);
  Finding finding{
      FindingCode::steering_steps,
      serious ? Severity::serious : Severity::warning,
      {"steering"},
      fmt::format(
          "the steering angle comes in steps of {:.3g} {}, errors of {:.1f} % of its motion; "
          "with the angle bridged between them {}",
          shown, unit, 100.0 * share, changes),
      fmt::format(
          "'steps: {:.3g} {}' beside the column of the steering angle fits the bridged one; "
          "better is a finer sensor, or one at the steering wheel",
          shown, unit)};
  finding.changes = {
      {"", fmt::format("inputs: {{{}: {{steps: {:.3g} {}}}}}", channel.name, shown, unit)}};
  return {finding};
}

}  // namespace identikal
