#include "identify/vehicle/usable_data.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "identify/survey/events.h"
#include "identify/vehicle/steering_steps.h"
#include "lib/base/constants.h"
#include "lib/base/error.h"
#include "lib/base/median.h"
#include "lib/base/nearest_name.h"
#include "lib/data/units.h"
#include "lib/formula/expression.h"

namespace identikal {
namespace {

constexpr Eigen::Index kFewestRows = 8;
constexpr double kShortest = 1.0;        // [s]
constexpr double kLongestGap = 3.0;      // [sampling periods]
constexpr double kSlowestModel = 0.5;    // [m/s]; the model divides by the speed
constexpr double kNearlyFast = 0.9;      // and not below this share of it, which is no noise
constexpr double kSpeedNoise = 0.25;     // [s]; for so long the speed may be below the least one
constexpr double kMovedSteering = 1e-4;  // [rad] at the sensor

Location in(const Dataset& data) { return Location{data.name, 0, 0}; }

VehicleRun::Output output_of(const Model& model, const Dataset& data, std::size_t index) {
  const std::string& name = model.outputs[index].name;
  const auto quantity = vehicle_quantity(name);
  if (!quantity) {
    throw InputError(model.outputs[index].at, "output '" + name + "' of a single-track vehicle",
                     "r, vy, ay or beta", did_you_mean(name, {"r", "vy", "ay", "beta"}));
  }
  VehicleRun::Output output;
  output.name = name;
  output.channel = static_cast<Eigen::Index>(index);
  output.unit = index < data.outputs.size() ? data.outputs[index].unit : "";
  output.sensor.quantity = *quantity;
  const VehicleModel& vehicle = as_vehicle(model);
  if (const auto at = vehicle.sensors.find(name); at != vehicle.sensors.end()) {
    output.sensor.x = at->second.x;
    output.sensor.y = at->second.y;
    output.sensor.angle = at->second.angle;
  }
  if (index < vehicle.measurement_sd.size()) output.given_sd = vehicle.measurement_sd[index];
  return output;
}

/// Why rows were not used, for the message when none is left.
struct Losses {
  Eigen::Index no_steering = 0, no_speed = 0, no_roll = 0, unwanted = 0, flagged = 0, spinning = 0,
               sliding = 0, slow = 0, fragments = 0, segments = 0;

  Losses& operator+=(const Losses& other) {
    no_steering += other.no_steering;
    no_speed += other.no_speed;
    no_roll += other.no_roll;
    unwanted += other.unwanted;
    flagged += other.flagged;
    spinning += other.spinning;
    sliding += other.sliding;
    slow += other.slow;
    fragments += other.fragments;
    segments += other.segments;
    return *this;
  }
};

constexpr double kLongestStep = 1.0;  // [s]

/// Sets the marks of the runs of unmarked rows that last no longer than `bridge`, and that have marked
/// rows before and behind them.
void bridge(const Dataset& data, double bridge, std::vector<bool>& marks) {
  Eigen::Index last = -1;  // marked
  for (Eigen::Index t = 0; t < data.size(); ++t) {
    if (!marks[t]) continue;
    const bool short_enough = last >= 0 && data.time[t] - data.time[last] - data.dt <= bridge;
    for (Eigen::Index k = last + 1; k < t && short_enough; ++k) marks[k] = true;
    last = t;
  }
}

/// Takes the marks off rows that are so near to an unmarked one.
void shrink(const Dataset& data, double margin, std::vector<bool>& marks) {
  const std::vector<bool> before = marks;
  for (Eigen::Index t = 0; t < data.size(); ++t) {
    if (before[t]) continue;
    for (Eigen::Index k = t; k >= 0 && data.time[t] - data.time[k] <= margin; --k) marks[k] = false;
    for (Eigen::Index k = t; k < data.size() && data.time[k] - data.time[t] <= margin; ++k) {
      marks[k] = false;
    }
  }
}

/// Rows where the model file's condition holds. Where a channel has no sample its last one counts.
std::vector<bool> wanted_rows(const RowCondition& use_when, const Dataset& data) {
  std::vector<double> symbols(static_cast<std::size_t>(data.u.rows() + data.y.rows()), kNone);
  std::vector<bool> out(static_cast<std::size_t>(data.size()));
  for (Eigen::Index t = 0; t < data.size(); ++t) {
    for (Eigen::Index i = 0; i < data.u.rows() + data.y.rows(); ++i) {
      const double value = i < data.u.rows() ? data.u(i, t) : data.y(i - data.u.rows(), t);
      if (std::isfinite(value)) symbols[i] = value;
    }
    const double holds = evaluate(use_when.holds, symbols);
    out[t] = std::isfinite(holds) && holds != 0.0;
  }
  bridge(data, use_when.bridge, out);
  if (use_when.margin > 0.0) shrink(data, use_when.margin, out);
  return out;
}

bool asks(const Expression& condition, Eigen::Index input) {
  return std::any_of(
      condition.nodes.begin(), condition.nodes.end(),
      [&](const Expression::Node& node) { return node.op == Op::symbol && node.symbol == input; });
}

/// Flags that use_when does not ask: where one of them is set, not 0, a row is not wanted. Where it
/// has no sample its last one counts.
std::vector<bool> unflagged_rows(const Model& model, const Dataset& data, Findings& findings) {
  const std::optional<RowCondition>& use_when = as_vehicle(model).use_when;
  std::vector<bool> out(static_cast<std::size_t>(data.size()), true);
  for (Eigen::Index i = has_measured_roll(model) ? 3 : 2; i < data.u.rows(); ++i) {
    if (use_when && asks(use_when->holds, i)) continue;
    std::vector<bool> set(out.size(), false);
    bool now = false;
    for (Eigen::Index t = 0; t < data.size(); ++t) {
      if (std::isfinite(data.u(i, t))) now = data.u(i, t) != 0.0;
      set[t] = now;
      out[t] = out[t] && !now;
    }
    append(findings, check_rows_left_out(model.inputs[i].name + " is set", set, data.time));
  }
  return out;
}

/// Takes the rows out; how many they are.
Eigen::Index leave_out(const std::vector<Spin>& events, std::vector<bool>& rows) {
  Eigen::Index out = 0;
  for (const Spin& event : events) {
    out += event.rows;
    for (Eigen::Index k = 0; k < event.rows; ++k) rows[event.first + k] = false;
  }
  return out;
}

SpinSignals spin_signals(const Model& model, const Dataset& data) {
  const auto output = [&](const char* name) -> Eigen::VectorXd {
    for (std::size_t i = 0; i < model.outputs.size(); ++i) {
      if (model.outputs[i].name == name)
        return data.y.row(static_cast<Eigen::Index>(i)).transpose();
    }
    return {};
  };
  const Eigen::VectorXd vx = data.u.row(1).transpose(), beta = output("beta");
  Eigen::VectorXd vy = output("vy");
  if (vy.size() == 0 && beta.size() > 0) vy = vx.array() * beta.array().tan();
  return {data.time, data.u.row(0).transpose(), vx, output("r"), vy};
}

/// Rows that the file allows, by its condition and its flags.
std::vector<bool> allowed_rows(const Model& model, const Dataset& data, Findings& findings,
                               Losses& lost) {
  std::vector<bool> out(static_cast<std::size_t>(data.size()), true);
  if (const std::optional<RowCondition>& use_when = as_vehicle(model).use_when) {
    out = wanted_rows(*use_when, data);
    std::vector<bool> unwanted = out;
    unwanted.flip();
    append(findings, check_rows_left_out("use_when does not hold", unwanted, data.time));
  }
  lost.unwanted = std::count(out.begin(), out.end(), false);
  const std::vector<bool> unflagged = unflagged_rows(model, data, findings);
  lost.flagged = std::count(unflagged.begin(), unflagged.end(), false);
  for (std::size_t t = 0; t < out.size(); ++t) out[t] = out[t] && unflagged[t];
  return out;
}

void leave_out_events(const Model& model, const Dataset& data, std::vector<bool>& rows,
                      Findings& findings, Losses& lost) {
  const SpinSignals signals = spin_signals(model, data);
  const std::vector<Spin> spins = find_spins(signals),
                          slides = find_countersteering(signals, spins);
  // Tyres that bend may slide.
  const bool slides_left_out = as_vehicle(model).curve == TyreCurve::linear;
  append(findings, check_spins(spins, data.time, true));
  append(findings, check_countersteering(slides, data.time, slides_left_out));
  lost.spinning = leave_out(spins, rows);
  if (slides_left_out) lost.sliding = leave_out(slides, rows);
}

/// Rows that the model's equations and its file allow.
std::vector<bool> usable_rows(const Model& model, const Dataset& data, Findings& findings,
                              Losses& lost) {
  const double min_speed = std::max(as_vehicle(model).min_speed, kSlowestModel);
  std::vector<bool> fast(static_cast<std::size_t>(data.size()));
  for (Eigen::Index t = 0; t < data.size(); ++t) fast[t] = data.u(1, t) >= min_speed;
  bridge(data, kSpeedNoise, fast);
  std::vector<bool> out = allowed_rows(model, data, findings, lost);
  leave_out_events(model, data, out, findings, lost);
  for (Eigen::Index t = 0; t < data.size(); ++t) {
    const double vx = data.u(1, t);
    const bool has_steering = std::isfinite(data.u(0, t)), has_speed = std::isfinite(vx);
    const bool has_roll = !has_measured_roll(model) || std::isfinite(data.u(2, t));
    if (!has_steering) ++lost.no_steering;
    if (!has_speed) ++lost.no_speed;
    if (!has_roll) ++lost.no_roll;
    const bool slow =
        has_speed && !(fast[t] && vx >= std::max(kSlowestModel, kNearlyFast * min_speed));
    if (slow) ++lost.slow;
    out[t] = out[t] && has_steering && has_speed && has_roll && !slow;
  }
  return out;
}

/// How far apart rows may be for a simulation to go on from one to the other [s].
double longest_gap(const Model& model, const Dataset& data) {
  constexpr double kRounding = 1.0 + 1e-6;  // of time stamps
  return kRounding * std::max(kLongestGap * data.dt, as_vehicle(model).max_gap);
}

/// Straight lines across holes of an input that are no longer than a gap may be.
/// @return how many there are
int bridge_holes(const Eigen::VectorXd& time, double longest, Eigen::MatrixXd::RowXpr input) {
  int out = 0;
  Eigen::Index last = -1;  // with a sample
  for (Eigen::Index t = 0; t < input.size(); ++t) {
    if (!std::isfinite(input[t])) continue;
    if (last >= 0 && last + 1 < t && time[t] - time[last] <= longest) {
      const double slope = (input[t] - input[last]) / (time[t] - time[last]);
      for (Eigen::Index k = last + 1; k < t; ++k) {
        input[k] = input[last] + slope * (time[k] - time[last]);
      }
      ++out;
    }
    last = t;
  }
  return out;
}

/// The recording with short holes of steering, vx and roll bridged.
Dataset with_bridged_holes(const Model& model, Dataset data, int& holes) {
  for (Eigen::Index i = 0; i < (has_measured_roll(model) ? 3 : 2); ++i) {
    holes += bridge_holes(data.time, longest_gap(model, data), data.u.row(i));
  }
  return data;
}

/// @param gap  at most, within a segment [s]
std::vector<VehicleRun::Segment> split(const Dataset& data, const std::vector<bool>& usable,
                                       double gap, Losses& lost) {
  std::vector<VehicleRun::Segment> out;
  Eigen::Index first = -1;
  const auto close = [&](Eigen::Index end) {
    if (first >= 0) out.push_back({first, end - first});
    first = -1;
  };
  for (Eigen::Index t = 0; t < data.size(); ++t) {
    if (!usable[t]) {
      close(t);
      continue;
    }
    if (first >= 0 && data.time[t] - data.time[t - 1] > gap) close(t);
    if (first < 0) first = t;
  }
  close(data.size());

  std::erase_if(out, [&](const VehicleRun::Segment& s) {
    const double seconds = data.time[s.first + s.rows - 1] - data.time[s.first] + data.dt;
    const bool fragment = s.rows < kFewestRows || seconds < kShortest;
    if (fragment) {
      lost.fragments += s.rows;
      ++lost.segments;
    }
    return fragment;
  });
  return out;
}

/// @param which  "recording 2 of 3: ", or nothing where there is one
[[noreturn]] void no_usable_row(const Dataset& data, double min_speed, const Losses& lost,
                                const std::string& which) {
  const Eigen::Index N = data.size();
  const auto present = data.u.row(1).array() == data.u.row(1).array();
  const bool backwards = lost.slow == N && (present && data.u.row(1).array() < 0.0).all();
  std::string why;
  const auto add = [&](const std::string& reason) { why += (why.empty() ? "" : ", ") + reason; };
  if (lost.slow > 0) {
    const double fastest = present.select(data.u.row(1).array(), -kInfinity).maxCoeff();
    add(fmt::format("{} below {:.3g} m/s (the fastest row has {:.3g} m/s)", lost.slow, min_speed,
                    fastest));
  }
  if (lost.no_speed > 0) add(fmt::format("{} without vx", lost.no_speed));
  if (lost.no_steering > 0) add(fmt::format("{} without steering angle", lost.no_steering));
  if (lost.unwanted > 0) add(fmt::format("{} where use_when does not hold", lost.unwanted));
  if (lost.flagged > 0) add(fmt::format("{} where a flag is set", lost.flagged));
  if (lost.spinning > 0) add(fmt::format("{} where the car spins", lost.spinning));
  if (lost.sliding > 0) add(fmt::format("{} where it is held in a slide", lost.sliding));
  if (lost.no_roll > 0) add(fmt::format("{} without roll", lost.no_roll));
  if (lost.fragments > 0) add(fmt::format("{} in fragments", lost.fragments));
  throw InputError(
      in(data),
      fmt::format("{}no usable segment in {} row{}{}{}", which, N, N == 1 ? "" : "s",
                  why.empty() ? "" : ": ", why),
      fmt::format("at least {} rows and {:g} s in a row with steering angle and vx", kFewestRows,
                  kShortest),
      backwards ? "vx is negative: does the car reverse, or its axis point backwards (scale: -1)?"
      : lost.slow == N ? "is the unit of vx right?"
                       : "");
}

/// Takes over the samples of the outputs, leaves out those that are dead.
/// @param all  outputs of the model x rows of all recordings
void pick_outputs(const Model& model, const Dataset& data, const Eigen::MatrixXd& all,
                  VehicleRun& run) {
  std::string dead;
  std::vector<Eigen::VectorXd> rows;
  for (std::size_t i = 0; i < model.outputs.size(); ++i) {
    VehicleRun::Output output = output_of(model, data, i);
    Eigen::VectorXd y = Eigen::VectorXd::Constant(all.cols(), kNone);
    double lowest = kInfinity, highest = -lowest;
    for (const VehicleRun::Segment& s : run.segments) {
      for (Eigen::Index t = s.first; t < s.first + s.rows; ++t) {
        const double value = all(output.channel, t);
        if (!std::isfinite(value)) continue;
        y[t] = value;
        ++output.samples;
        lowest = std::min(lowest, value);
        highest = std::max(highest, value);
      }
    }
    std::string trouble;
    if (output.samples == 0) {
      trouble = fmt::format("output '{}' has no sample in the rows used", output.name);
    } else if (lowest == highest) {
      trouble = fmt::format("output '{}' is constant at {:.6g} {}", output.name,
                            unit_or_dimensionless(output.unit).from_si(lowest), output.unit);
    }
    if (trouble.empty()) {
      rows.push_back(std::move(y));
      run.outputs.push_back(std::move(output));
      continue;
    }
    dead += (dead.empty() ? "" : "; ") + trouble;
    run.findings.push_back(make_finding(FindingCode::dead_output, {output.name},
                                        trouble + "; it is left out",
                                        "check the channel, or take it out of the model file"));
  }
  if (run.outputs.empty()) {
    throw InputError(in(data), dead.empty() ? "the model has no output" : dead,
                     "at least one measured output that moves");
  }
  run.y.resize(static_cast<Eigen::Index>(rows.size()), all.cols());
  for (std::size_t j = 0; j < rows.size(); ++j) {
    run.y.row(static_cast<Eigen::Index>(j)) = rows[j].transpose();
  }
}

/// Between the steps of its sensor, where the model file says how large they are [rad].
void bridge_steering(double step, VehicleRun& run) {
  if (!(step > 0.0)) return;
  for (const VehicleRun::Segment& s : run.segments) {
    run.steering.segment(s.first, s.rows) = bridged_steps(
        run.time.segment(s.first, s.rows), run.steering.segment(s.first, s.rows), step);
  }
  run.notes.emplace_back("the steering angle is bridged between the steps of its sensor");
}

void require_steering(const Dataset& data, VehicleRun& run) {
  double lowest = kInfinity, highest = -lowest;
  for (const VehicleRun::Segment& s : run.segments) {
    lowest = std::min(lowest, run.steering.segment(s.first, s.rows).minCoeff());
    highest = std::max(highest, run.steering.segment(s.first, s.rows).maxCoeff());
  }
  if (highest - lowest >= kMovedSteering) return;
  const std::string seen = fmt::format("the steering angle stays between {:.4g} and {:.4g} deg",
                                       kDegreesPerRadian * lowest, kDegreesPerRadian * highest);
  if (std::max(std::abs(lowest), std::abs(highest)) < 100.0 * kMovedSteering) {
    throw InputError(in(data), fmt::format("no steering: {} in the {} rows used", seen, run.used),
                     "a manoeuvre that excites the car",
                     "is it the right column, and is its unit right?");
  }
  run.findings.push_back(make_finding(FindingCode::constant_steering, {},
                                      seen + ": the car is hardly excited",
                                      "record a manoeuvre: lane change, step, sine or sweep"));
}

/// What no car does is a mark for a missing value, or a wrong unit; its squares might overflow.
void require_possible(const Model& model, const Dataset& data) {
  constexpr double kImpossible = 1e6;  // in SI, of any channel
  for (const bool input : {true, false}) {
    const Eigen::MatrixXd& values = input ? data.u : data.y;
    for (Eigen::Index t = 0; t < values.cols(); ++t) {
      for (Eigen::Index i = 0; i < values.rows(); ++i) {
        if (!(std::abs(values(i, t)) > kImpossible)) continue;
        const ChannelSource& channel = (input ? model.inputs : model.outputs)[i];
        throw InputError(in(data),
                         fmt::format("{} is {:g} in SI units at {:.6g} s", channel.name,
                                     values(i, t), data.time[t]),
                         "what a car may do",
                         "leave cells empty where nothing was measured; is a unit wrong?");
      }
    }
  }
}

void require_shape(const Model& model, const Dataset& data) {
  const bool rolls = has_measured_roll(model);
  if (data.u.rows() != static_cast<Eigen::Index>(model.inputs.size()) ||
      data.u.cols() != data.size()) {
    throw InputError(in(data), fmt::format("{} inputs", data.u.rows()),
                     fmt::format("the {} of the model: the steering angle, then vx{}",
                                 model.inputs.size(), rolls ? ", then roll" : ""));
  }
  if (data.y.rows() != static_cast<Eigen::Index>(model.outputs.size()) ||
      data.y.cols() != data.size()) {
    throw InputError(in(data), fmt::format("{} outputs", data.y.rows()),
                     fmt::format("the {} of the model", model.outputs.size()));
  }
  if (data.dt > kLongestStep) {
    throw InputError(
        in(data), fmt::format("rows are {:.6g} s apart", data.dt),
        fmt::format("at most {:g} s: a car's yaw motion is over within a second", kLongestStep),
        "if the time column is in ms, write unit: ms under 'time' in the model file");
  }
}

/// What the simulation goes across, in a sentence; empty where there is nothing.
/// @param holes  of inputs
std::string bridged_gaps(const VehicleRun& run, int holes) {
  int gaps = 0;
  double longest = 0.0;
  for (const VehicleRun::Segment& s : run.segments) {
    for (Eigen::Index t = s.first + 1; t < s.first + s.rows; ++t) {
      const double apart = run.time[t] - run.time[t - 1];
      if (!(apart > kLongestGap * run.step)) continue;
      ++gaps;
      longest = std::max(longest, apart);
    }
  }
  std::vector<std::string> out;
  if (gaps > 0) {
    out.push_back(fmt::format("{} gap{} of up to {:.2g} s", gaps, gaps == 1 ? "" : "s", longest));
  }
  if (holes > 0) {
    out.push_back(fmt::format("{} hole{} in inputs", holes, holes == 1 ? "" : "s"));
  }
  if (out.empty()) return "";
  return fmt::format("bridged by the simulation (max_gap): {}", fmt::join(out, " and "));
}

}  // namespace

Eigen::Index VehicleRun::find(VehicleQuantity quantity) const {
  for (std::size_t j = 0; j < outputs.size(); ++j) {
    if (outputs[j].sensor.quantity == quantity) return static_cast<Eigen::Index>(j);
  }
  return -1;
}

VehicleRun usable_run(const Model& model, const std::vector<Dataset>& recordings) {
  if (recordings.empty()) throw std::invalid_argument("there is no recording");
  VehicleRun run;
  Losses lost;
  const double min_speed = std::max(as_vehicle(model).min_speed, kSlowestModel);
  Eigen::Index N = 0;
  for (const Dataset& data : recordings) N += data.size();
  run.time.resize(N);
  run.steering.resize(N);
  run.vx.resize(N);
  if (has_measured_roll(model)) run.roll.resize(N);
  Eigen::MatrixXd y(static_cast<Eigen::Index>(model.outputs.size()), N);
  std::vector<double> speeds, steps;
  Eigen::Index at = 0;
  int holes = 0;
  for (const Dataset& recorded : recordings) {
    require_shape(model, recorded);
    require_possible(model, recorded);
    const Dataset data = with_bridged_holes(model, recorded, holes);
    Losses here;
    std::vector<VehicleRun::Segment> segments =
        split(data, usable_rows(model, data, run.findings, here), longest_gap(model, data), here);
    if (segments.empty()) {
      no_usable_row(
          data, min_speed, here,
          recordings.size() > 1
              ? fmt::format("recording {} of {}: ", run.used_of.size() + 1, recordings.size())
              : "");
    }
    lost += here;
    run.time.segment(at, data.size()) = data.time;
    run.steering.segment(at, data.size()) = data.u.row(0).transpose();
    run.vx.segment(at, data.size()) = data.u.row(1).transpose();
    if (run.roll.size() > 0) run.roll.segment(at, data.size()) = data.u.row(2).transpose();
    y.middleCols(at, data.size()) = data.y;
    run.recording.insert(run.recording.end(), static_cast<std::size_t>(data.size()),
                         static_cast<int>(run.used_of.size()));
    run.used_of.push_back(0);
    for (const VehicleRun::Segment& s : segments) {
      run.segments.push_back({at + s.first, s.rows});
      run.used += s.rows;
      run.used_of.back() += s.rows;
      const double* vx = run.vx.data() + at + s.first;
      speeds.insert(speeds.end(), vx, vx + s.rows);
    }
    steps.push_back(data.dt);
    at += data.size();
  }
  run.median_speed = median(std::move(speeds));
  run.step = median(std::move(steps));
  bridge_steering(as_vehicle(model).steering_steps, run);
  pick_outputs(model, recordings.front(), y, run);
  require_steering(recordings.front(), run);

  std::string note = fmt::format("{} of {} rows used in {} segment{}", run.used, N,
                                 run.segments.size(), run.segments.size() == 1 ? "" : "s");
  if (recordings.size() > 1) note += fmt::format(" of {} recordings", recordings.size());
  if (lost.slow > 0) note += fmt::format("; {} rows below {:.3g} m/s", lost.slow, min_speed);
  if (lost.no_speed > 0) note += fmt::format("; {} without vx", lost.no_speed);
  if (lost.no_steering > 0) note += fmt::format("; {} without steering angle", lost.no_steering);
  if (lost.unwanted > 0) {
    note += fmt::format("; {} where use_when does not hold", lost.unwanted);
  }
  if (lost.flagged > 0) note += fmt::format("; {} where a flag is set", lost.flagged);
  if (lost.spinning > 0) note += fmt::format("; {} where the car spins", lost.spinning);
  if (lost.sliding > 0) note += fmt::format("; {} where it is held in a slide", lost.sliding);
  if (lost.no_roll > 0) note += fmt::format("; {} without roll", lost.no_roll);
  if (lost.fragments > 0) {
    note += fmt::format("; {} rows dropped in {} short segments", lost.fragments, lost.segments);
  }
  run.notes.push_back(note);
  if (const std::string bridged = bridged_gaps(run, holes); !bridged.empty()) {
    run.notes.push_back(bridged);
  }
  return run;
}

}  // namespace identikal
