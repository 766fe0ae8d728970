#include "identify/vehicle/track.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "identify/estimate/parameter_table.h"
#include "identify/model/check.h"
#include "identify/regression/order.h"
#include "identify/regression/track.h"
#include "identify/vehicle/output_error.h"
#include "identify/vehicle/starts.h"
#include "identify/vehicle/usable_data.h"
#include "lib/base/error.h"
#include "lib/base/median.h"
#include "lib/regression/least_squares.h"
#include "lib/regression/recursive_least_squares.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kSoftConstraint = 0.01;   // [(m/s^2)^2]
constexpr double kLeastForgetting = 0.98;  // chosen, per mean of 0.1 s: 5 s of memory
constexpr Index kFewestMeans = 30;         // of the balances

// Of every second row, from `first` on.
VectorXd every_second(const VectorXd& rows, Index first) {
  return Eigen::Map<const VectorXd, 0, Eigen::InnerStride<2>>(rows.data() + first, rows.size() / 2);
}

double median_size(const VectorXd& v) {
  const VectorXd size = v.cwiseAbs();
  return median({size.begin(), size.end()});
}

// The balances as rows of one regression, two for each point of time: force, then moment.
struct BalanceRows {
  std::vector<VehicleParameter> unknown;  // the coefficients
  MatrixXd phi;                           // unknown x 2n [m/s^2]
  VectorXd y;                             // 2n [m/s^2]
  double moment = 0.0;                    // what m r' is multiplied with in a moment row [m]
};

// Coefficients are changes relative to the values in p; what is not estimated goes to the other
// side.
BalanceRows rows_of(const VehicleBalances& balances, const VehicleUnknowns& unknowns) {
  const VehicleParameters<double>& p = unknowns.value;
  const Index n = balances.time.size();
  const double length = std::sqrt(p[kA] * p[kB]);
  MatrixXd all = MatrixXd::Zero(3, 2 * n);
  VectorXd y(2 * n);
  for (Index t = 0; t < n; ++t) {
    const double front = p[kCf] / p[kMass] * balances.slip_front[t],
                 rear = p[kCr] / p[kMass] * balances.slip_rear[t];
    all.col(2 * t) << front, rear, 0.0;
    all.col(2 * t + 1) << p[kA] / length * front, -p[kB] / length * rear,
        -p[kYawInertia] / (p[kMass] * length) * balances.yaw_acceleration[t];
    y.segment<2>(2 * t) << balances.acceleration[t], 0.0;
  }
  y -= all.colwise().sum().transpose();
  BalanceRows out;
  std::vector<Index> picked;
  constexpr VehicleParameter kOrder[] = {kCf, kCr, kYawInertia};
  for (Index i = 0; i < 3; ++i) {
    const auto& free = unknowns.free;
    if (std::find(free.begin(), free.end(), kOrder[i]) == free.end()) continue;
    picked.push_back(i);
    out.unknown.push_back(kOrder[i]);
  }
  out.phi = all(picked, Eigen::all);
  out.y = std::move(y);
  // Both balances count by what they leave unexplained over the whole recording; medians, because
  // coefficients that change leave much of it somewhere.
  double weight = 1.0;
  if (!picked.empty()) {
    const VectorXd e = least_squares(out.phi.transpose(), out.y).residuals;
    const double force = median_size(every_second(e, 0)), moment = median_size(every_second(e, 1));
    if (std::min(force, moment) > 1e-6 * std::max(force, moment)) weight = force / moment;
  }
  for (Index t = 0; t < n; ++t) {
    out.phi.col(2 * t + 1) *= weight;
    out.y[2 * t + 1] *= weight;
  }
  out.moment = weight / length;
  return out;
}

// What the two rows of each point of time leave.
RegressionHistory after_both(const RegressionHistory& rows) {
  const Index n = rows.lambda.size() / 2;
  RegressionHistory out = rows;
  out.lambda.resize(n);
  out.log_alarm.resize(n);
  out.theta.resize(Eigen::NoChange, n);
  out.sd.resize(Eigen::NoChange, n);
  for (Index t = 0; t < n; ++t) {
    out.theta.col(t) = rows.theta.col(2 * t + 1);
    out.sd.col(t) = rows.sd.col(2 * t + 1);
    out.lambda[t] = rows.lambda[2 * t] * rows.lambda[2 * t + 1];
    out.log_alarm[t] = std::fmax(rows.log_alarm[2 * t], rows.log_alarm[2 * t + 1]);
  }
  for (RegressionHistory::Change& change : out.changes) {
    change.since /= 2;
    change.found /= 2;
  }
  return out;
}

VehicleBalances tracked_balances(const Model& model, const Dataset& recording,
                                 const VehicleRun& run, const VehicleParameters<double>& p) {
  VehicleBalances out = vehicle_balances(run, p);
  const Index n = out.time.size();
  if (n == 0 && (run.find(VehicleQuantity::r) < 0 || run.outputs.size() < 2)) {
    throw InputError({model.source, 0, 0},
                     "the outputs do not show the balances of force and moment",
                     "r and one of vy, beta and ay");
  }
  if (n < kFewestMeans) {
    throw InputError({recording.name, 0, 0},
                     fmt::format("{} means of 0.1 s with neighbours on both sides", n),
                     fmt::format("{} or more", kFewestMeans));
  }
  return out;
}

// How the past is forgotten, per point of time.
struct TrackForgetting {
  Forgetting forgetting;
  bool chosen = false;  // by the recording

  // Each row is half a point of time.
  Forgetting per_row() const {
    Forgetting out = forgetting;
    out.factor = std::sqrt(forgetting.factor);
    out.memory = 2.0 * forgetting.memory;
    out.samples_per_false_alarm = 2.0 * forgetting.samples_per_false_alarm;
    return out;
  }
  bool is_shortest() const {
    return chosen && forgetting.factor < 1.0 &&
           forgetting.factor <= kLeastForgetting * (1.0 + 1e-6);
  }
};

TrackForgetting track_forgetting(const RegressionModel& settings, const BalanceRows& rows) {
  TrackForgetting out;
  out.chosen = !settings.forgetting && settings.memory == 0.0;
  double factor = 1.0;
  if (out.chosen) {
    factor = std::pow(
        choose_forgetting(rows.phi, rows.y, kSoftConstraint, std::sqrt(kLeastForgetting)), 2);
  }
  out.forgetting = forgetting_of(settings, factor);
  return out;
}

// The tracked parameters, in the order of the model file.
struct TrackedParameters {
  std::vector<Index> order;  // their coefficients
  VectorXd scale;            // of a parameter with its coefficient, in its unit
  std::string held;          // names of free ones that are not tracked
};

TrackedParameters report_time_history(const VehicleUnknowns& unknowns, const BalanceRows& rows,
                                      const VectorXd& time, const RegressionHistory& track,
                                      TrackedCoefficients& estimate) {
  const auto count = static_cast<Index>(rows.unknown.size());
  TimeHistory& history = estimate.time_history;
  history.mean.resize(count, time.size());
  history.sd.resize(count, time.size());
  TrackedParameters out;
  out.scale.resize(count);
  for (std::size_t i = 0; i < unknowns.free.size(); ++i) {
    EstimatedParameter& reported = estimate.parameters[unknowns.position[i]];
    const auto hit = std::find(rows.unknown.begin(), rows.unknown.end(), unknowns.free[i]);
    if (hit == rows.unknown.end()) {
      out.held += (out.held.empty() ? "" : ", ") + reported.name;
      reported.fixed = true;
      continue;
    }
    const auto k = static_cast<Index>(out.order.size());
    const Index coefficient = hit - rows.unknown.begin();
    out.order.push_back(coefficient);
    out.scale[k] = unknowns.value[unknowns.free[i]] / unit_scale(reported.unit);
    history.names.push_back(reported.name);
    history.units.push_back(reported.unit);
    history.mean.row(k) = out.scale[k] * (1.0 + track.theta.row(coefficient).array());
    history.sd.row(k) = out.scale[k] * track.sd.row(coefficient);
    reported.value = history.mean(k, time.size() - 1);
  }
  history.changes = reported_changes(track.changes, time, history.mean);
  history.log_alarm = track.log_alarm;
  return out;
}

// What the end of the recording determines.
void report_end(const RecursiveLeastSquares& end, const TrackedParameters& tracked,
                TrackedCoefficients& estimate) {
  const double noise = std::max(1e-30, noise_variance(end)[0]);
  const VectorXd per_scale = tracked.scale.cwiseInverse();
  const std::vector<Index>& order = tracked.order;
  judge_parameters(
      estimate,
      per_scale.asDiagonal() * (information_of_rows(end)(order, order) / noise).eval() *
          per_scale.asDiagonal(),
      tracked.scale.asDiagonal() * (inverse_correlation(end)(order, order) * noise).eval() *
          tracked.scale.asDiagonal());
  estimate.covariance_kind =
      "the noise at the end times P; noise in the regressors biases the values on top";
}

// Predictions made before each point of time.
void report_predictions(const VehicleBalances& balances, const BalanceRows& rows,
                        const VehicleParameters<double>& p, const RegressionHistory& by_row,
                        TrackedCoefficients& estimate) {
  // The moment's error as one of the yaw acceleration, with the file's inertia.
  const VectorXd force_error = every_second(by_row.prior_error, 0);
  const VectorXd moment_error =
      p[kMass] / (rows.moment * p[kYawInertia]) * every_second(by_row.prior_error, 1);
  estimate.one_step = {
      one_step_fit("ay", "m/s^2", balances.acceleration, force_error),
      one_step_fit("yaw acceleration", "rad/s^2", balances.yaw_acceleration, moment_error)};
  Series& series = estimate.series;
  series.time = balances.time;
  series.channels = {"ay", "yaw acceleration"};
  series.units = {"m/s^2", "rad/s^2"};
  series.measured.resize(2, balances.time.size());
  series.predicted = series.standardised = series.measured;
  series.measured << balances.acceleration.transpose(), balances.yaw_acceleration.transpose();
  series.predicted.row(0) = (balances.acceleration - force_error).transpose();
  series.predicted.row(1) = (balances.yaw_acceleration - moment_error).transpose();
  for (Index k = 0; k < 2; ++k) {
    series.standardised.row(k) = every_second(by_row.standardised, k).transpose();
  }
}

/// Parameters that the end of the recording leaves open.
Findings check_end(const TrackedCoefficients& estimate) {
  std::string open;
  for (const EstimatedParameter& each : estimate.parameters) {
    const bool determined =
        each.verdict != Verdict::not_identifiable && each.verdict != Verdict::unexcited;
    if (each.fixed || (determined && each.value > 0.0)) continue;
    open += (open.empty() ? "" : ", ") + each.name;
  }
  if (open.empty()) return {};
  return {make_finding(FindingCode::not_identifiable, {},
                       "the end of this recording does not determine " + open)};
}

}  // namespace

TrackedCoefficients track_vehicle(const Model& given, const Dataset& recording) {
  refuse_constraints(given, "track");
  const Model model = checked(given, {recording});
  const VehicleUnknowns unknowns = vehicle_unknowns(model);
  const VehicleRun run = usable_run(model, {recording});
  if (has_late_sensor(run, unknowns)) {
    throw InputError({model.source, 0, 0}, "track with a delay or lag in 'sensors'",
                     "a known delay beside the column: {column: ..., delay: 80 ms}");
  }
  const VehicleBalances balances = tracked_balances(model, recording, run, unknowns.value);
  const BalanceRows rows = rows_of(balances, unknowns);
  if (rows.unknown.empty()) {
    throw InputError({model.source, 0, 0}, "none of Cf, Cr and Iz is free",
                     "one of them as {value: ..., min: ..., max: ...}");
  }
  const TrackForgetting past = track_forgetting(as_vehicle(model).tracking, rows);
  const RegressionHistory by_row =
      run_recursive_least_squares(rows.phi, rows.y, kSoftConstraint, past.per_row());
  const RegressionHistory track = after_both(by_row);

  TrackedCoefficients estimate;
  estimate.verb = "track";
  estimate.model_name = model.name;
  estimate.objective.method = "recursive least squares on force and moment";
  estimate.inputs.push_back(
      {recording.name, "", static_cast<long>(recording.size()), static_cast<long>(run.used)});
  estimate.findings = run.findings;
  estimate.notes = run.notes;
  list_parameters(estimate, model.parameters, model.parameters);
  const TrackedParameters tracked =
      report_time_history(unknowns, rows, balances.time, track, estimate);
  if (past.forgetting.reset || past.forgetting.watch) {
    estimate.time_history.log_threshold = std::log(past.per_row().samples_per_false_alarm);
  }
  report_end(by_row.end, tracked, estimate);
  report_predictions(balances, rows, unknowns.value, by_row, estimate);
  estimate.notes.push_back(describe_forgetting(past.forgetting, track, past.chosen) +
                           "; a sample is a mean of 0.1 s");
  if (!tracked.held.empty()) {
    estimate.notes.push_back("fixed at the file's value, because only Cf, Cr and Iz are tracked: " +
                             tracked.held);
  }
  estimate.findings.push_back(make_finding(
      FindingCode::tracked_only, {},
      "recursive least squares follows changes; noise in its regressors biases the values, and "
      "the standard errors do not include that bias",
      "take values from 'identikal fit'"));
  append(estimate.findings,
         check_regression(every_second(by_row.standardised, 0), past.is_shortest()));
  append(estimate.findings, check_end(estimate));
  const std::size_t count = rows.unknown.size();
  conclude(estimate,
           fmt::format("{} parameter{} tracked over {} means of 0.1 s", count,
                       count == 1 ? "" : "s", balances.time.size()),
           Basis::tests);
  return estimate;
}

}  // namespace identikal
