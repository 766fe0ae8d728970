#include "identify/vehicle/track.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "identify/estimate/parameter_table.h"
#include "identify/regression/order.h"
#include "identify/regression/track.h"
#include "identify/vehicle/output_error.h"
#include "identify/vehicle/starts.h"
#include "identify/vehicle/usable_data.h"
#include "lib/base/error.h"
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

double median_size(VectorXd v) {
  v = v.cwiseAbs();
  std::nth_element(v.begin(), v.begin() + v.size() / 2, v.end());
  return v[v.size() / 2];
}

// The balances as rows of one regression, two for each point of time: force, then moment.
struct BalanceRows {
  std::vector<VehicleParameter> sought;  // the coefficients
  MatrixXd phi;                          // sought x 2n [m/s^2]
  VectorXd y;                            // 2n [m/s^2]
  double moment = 0.0;                   // what m r' is multiplied with in a moment row [m]
};

// Coefficients are changes relative to the values in p; what is not sought goes to the other side.
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
    out.sought.push_back(kOrder[i]);
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

}  // namespace

Estimate track_vehicle(const ModelFile& model, const Dataset& recording) {
  const VehicleUnknowns unknowns = vehicle_unknowns(model);
  const VehicleParameters<double>& p = unknowns.value;
  const VehicleRun run = usable_run(model, {recording});
  const VehicleBalances balances = vehicle_balances(run, p);
  const Index n = balances.time.size();
  if (n == 0 && (run.find(VehicleQuantity::r) < 0 || run.outputs.size() < 2)) {
    throw InputError({model.path, 0, 0}, "the outputs do not show the balances of force and moment",
                     "r and one of vy, beta and ay");
  }
  if (n < kFewestMeans) {
    throw InputError({recording.name, 0, 0},
                     fmt::format("{} means of 0.1 s with neighbours on both sides", n),
                     fmt::format("{} or more", kFewestMeans));
  }
  const BalanceRows rows = rows_of(balances, unknowns);
  if (rows.sought.empty()) {
    throw InputError({model.path, 0, 0}, "none of Cf, Cr and Iz is sought",
                     "one of them as {value: ..., min: ..., max: ...}");
  }
  const bool chosen = !model.regression.forgetting && model.regression.memory == 0.0;
  // Settings are per point of time, of which each row is half.
  const Forgetting forgetting = forgetting_of(
      model.regression, chosen ? std::pow(choose_forgetting(rows.phi, rows.y, kSoftConstraint,
                                                            std::sqrt(kLeastForgetting)),
                                          2)
                               : 1.0);
  Forgetting per_row = forgetting;
  per_row.factor = std::sqrt(forgetting.factor);
  per_row.memory = 2.0 * forgetting.memory;
  per_row.samples_per_false_alarm = 2.0 * forgetting.samples_per_false_alarm;
  const RegressionHistory by_row =
      run_recursive_least_squares(rows.phi, rows.y, kSoftConstraint, per_row);
  const RegressionHistory track = after_both(by_row);

  Estimate estimate;
  estimate.verb = "track";
  estimate.model_name = model.name;
  estimate.objective.method = "recursive least squares on force and moment";
  estimate.inputs.push_back(
      {recording.name, "", static_cast<long>(recording.size()), static_cast<long>(run.used)});
  estimate.warnings = run.warnings;
  estimate.notes = run.notes;
  list_parameters(estimate, model.parameters, model.parameters);

  // In the order of the model file.
  TimeHistory& course = estimate.time_history.emplace();
  const auto count = static_cast<Index>(rows.sought.size());
  std::vector<Index> order;
  VectorXd scale(count);  // the parameter's change with its coefficient, in its unit
  course.mean.resize(count, n);
  course.sd.resize(count, n);
  std::string held;
  for (std::size_t i = 0; i < unknowns.free.size(); ++i) {
    EstimatedParameter& reported = estimate.parameters[unknowns.position[i]];
    const auto hit = std::find(rows.sought.begin(), rows.sought.end(), unknowns.free[i]);
    if (hit == rows.sought.end()) {
      held += (held.empty() ? "" : ", ") + reported.name;
      reported.fixed = true;
      continue;
    }
    const auto k = static_cast<Index>(order.size());
    order.push_back(hit - rows.sought.begin());
    scale[k] = p[unknowns.free[i]] / unit_scale(reported.unit);
    course.names.push_back(reported.name);
    course.units.push_back(reported.unit);
    course.mean.row(k) = scale[k] * (1.0 + track.theta.row(order.back()).array());
    course.sd.row(k) = scale[k] * track.sd.row(order.back());
    reported.value = course.mean(k, n - 1);
  }
  const double noise = std::max(1e-30, noise_variance(by_row.end)[0]);
  const VectorXd per_scale = scale.cwiseInverse();
  judge_parameters(
      estimate,
      per_scale.asDiagonal() * (information_of_rows(by_row.end)(order, order) / noise).eval() *
          per_scale.asDiagonal(),
      scale.asDiagonal() * (inverse_correlation(by_row.end)(order, order) * noise).eval() *
          scale.asDiagonal());
  estimate.covariance_kind =
      "the noise at the end times P; noise in the regressors biases the values on top";
  course.changes = reported_changes(track.changes, balances.time, course.mean);
  course.log_alarm = track.log_alarm;
  if (forgetting.reset || forgetting.watch) {
    course.log_threshold = std::log(per_row.samples_per_false_alarm);
  }

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
  series.measured.resize(2, n);
  series.predicted = series.standardised = series.measured;
  series.measured << balances.acceleration.transpose(), balances.yaw_acceleration.transpose();
  series.predicted.row(0) = (balances.acceleration - force_error).transpose();
  series.predicted.row(1) = (balances.yaw_acceleration - moment_error).transpose();
  for (Index k = 0; k < 2; ++k) {
    series.standardised.row(k) = every_second(by_row.standardised, k).transpose();
  }

  estimate.notes.push_back(describe_forgetting(forgetting, track, chosen) +
                           "; a sample is a mean of 0.1 s");
  if (!held.empty()) {
    estimate.notes.push_back("held at the file's value, because only Cf, Cr and Iz are tracked: " +
                             held);
  }
  warn(estimate.warnings, Severity::note, "tracked_only", {},
       "recursive least squares follows changes; noise in its regressors biases the values, and no "
       "standard error here knows of that",
       "take values from 'identikal fit'");
  warn_of_regression(
      estimate, every_second(by_row.standardised, 0),
      chosen && forgetting.factor < 1.0 && forgetting.factor <= kLeastForgetting * (1.0 + 1e-6));
  std::string open;
  for (const EstimatedParameter& each : estimate.parameters) {
    const bool shown =
        each.verdict != Verdict::not_identifiable && each.verdict != Verdict::unexcited;
    if (each.fixed || (shown && each.value > 0.0)) continue;
    open += (open.empty() ? "" : ", ") + each.name;
  }
  estimate.status = open.empty() ? Status::ok : Status::rejected;
  estimate.message = open.empty() ? fmt::format("{} parameter{} tracked over {} means of 0.1 s",
                                                count, count == 1 ? "" : "s", n)
                                  : "the end of this recording does not determine " + open;
  return estimate;
}

}  // namespace identikal
