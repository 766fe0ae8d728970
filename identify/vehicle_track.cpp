#include "identify/vehicle_track.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "identify/noise_estimate.h"
#include "identify/regression_choice.h"
#include "identify/regression_track.h"
#include "identify/vehicle_problem.h"
#include "identify/vehicle_run.h"
#include "identify/vehicle_starts.h"
#include "lib/error.h"
#include "lib/recursive_least_squares.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kSoftConstraint = 0.01;  // [(m/s^2)^2], [(rad/s^2)^2]
constexpr Index kFewestRows = 30;         // of the balances

bool sought(const VehicleUnknowns& unknowns, VehicleParameter parameter) {
  return std::find(unknowns.free.begin(), unknowns.free.end(), parameter) != unknowns.free.end();
}

// One parameter along the recording, SI.
struct TrackedParameter {
  VehicleParameter parameter;
  std::size_t position = 0;  // in Estimate::parameters
  VectorXd value, sd;
  std::size_t balance = 0;  // that tells it,
  Index coefficient = 0;    // which of its coefficients,
  double scale = 0.0;       // and the parameter's change with that, at the end
};

// What has been learnt from one of the balances.
struct BalanceTrack {
  std::string channel, unit;
  VectorXd measured;
  RegressionCourse course;
};

void report_balance(Estimate& estimate, const BalanceTrack& track, Index row) {
  Series& series = estimate.series;
  series.channels.push_back(track.channel);
  series.units.push_back(track.unit);
  series.measured.row(row) = track.measured.transpose();
  series.predicted.row(row) = (track.measured - track.course.prior_error).transpose();
  series.standardised.row(row) = track.course.standardised.transpose();
  estimate.one_step.push_back(
      one_step_fit(track.channel, track.unit, track.measured, track.course.prior_error));
}

}  // namespace

Estimate track_vehicle(const ModelFile& model, const Dataset& recording) {
  const VehicleUnknowns unknowns = vehicle_unknowns(model);
  const bool free_front = sought(unknowns, kCf), free_rear = sought(unknowns, kCr),
             free_inertia = sought(unknowns, kYawInertia);
  if (!free_front && !free_rear && !free_inertia) {
    throw InputError({model.path, 0, 0}, "none of Cf, Cr and Iz is sought",
                     "one of them as {value: ..., min: ..., max: ...}");
  }
  const VehicleRun run = usable_run(model, recording);
  const VehicleParameters<double>& p = unknowns.value;
  const VehicleBalances balances = vehicle_balances(run, p);
  const Index n = balances.time.size();
  if (n == 0 && (run.find(VehicleQuantity::r) < 0 || run.outputs.size() < 2)) {
    throw InputError({model.path, 0, 0}, "the outputs do not show the balances of force and moment",
                     "r and one of vy, beta and ay");
  }
  if (n < kFewestRows) {
    throw InputError({recording.name, 0, 0},
                     fmt::format("{} means of 0.1 s with neighbours on both sides", n),
                     fmt::format("{} or more", kFewestRows));
  }

  Estimate estimate;
  estimate.verb = "track";
  estimate.model_name = model.name;
  estimate.objective.method = "recursive least squares on force and moment";
  estimate.inputs.push_back(
      {recording.name, "", static_cast<long>(recording.size()), static_cast<long>(run.used)});
  estimate.warnings = run.warnings;
  estimate.notes = run.notes;
  list_parameters(estimate, model.parameters, model.parameters);

  // Accelerations of the start's forces; what is free adds a share of its own.
  MatrixXd force(2, n);
  force.row(0) = p[kCf] / p[kMass] * balances.slip_front.transpose();
  force.row(1) = p[kCr] / p[kMass] * balances.slip_rear.transpose();
  std::vector<TrackedParameter> tracked;
  std::vector<Index> rows;
  if (free_front) rows.push_back(0);
  if (free_rear) rows.push_back(1);
  std::vector<BalanceTrack> tracks;
  std::optional<Forgetting> forgetting;
  const auto run_balance = [&](const MatrixXd& phi, const VectorXd& known, BalanceTrack track) {
    const VectorXd y = track.measured - known;
    if (!forgetting) {
      const bool given = model.regression.forgetting || model.regression.memory > 0.0;
      forgetting =
          forgetting_of(model.regression, given ? 1.0 : choose_forgetting(phi, y, kSoftConstraint));
    }
    track.course = run_recursive_least_squares(phi, y, kSoftConstraint, *forgetting);
    tracks.push_back(std::move(track));
    return tracks.back().course;
  };
  MatrixXd share = MatrixXd::Ones(2, n);  // of the start's stiffness
  if (!rows.empty()) {
    const RegressionCourse course =
        run_balance(force(rows, Eigen::all), force.colwise().sum().transpose(),
                    {"ay", "m/s^2", balances.acceleration, {}});
    for (std::size_t k = 0; k < rows.size(); ++k) {
      const auto at = static_cast<Index>(k);
      const VehicleParameter parameter = rows[k] == 0 ? kCf : kCr;
      share.row(rows[k]) += course.theta.row(at);
      tracked.push_back({parameter, 0, p[parameter] * share.row(rows[k]).transpose(),
                         p[parameter] * course.sd.row(at).transpose(), 0, at, p[parameter]});
    }
  }
  if (free_inertia) {
    const VectorXd yaw = (p[kMass] / p[kYawInertia] *
                          (p[kA] * force.row(0).cwiseProduct(share.row(0)) -
                           p[kB] * force.row(1).cwiseProduct(share.row(1))))
                             .transpose();
    const RegressionCourse course = run_balance(
        yaw.transpose(), yaw, {"yaw acceleration", "rad/s^2", balances.yaw_acceleration, {}});
    const VectorXd inverse = 1.0 + course.theta.row(0).transpose().array();
    TrackedParameter inertia{kYawInertia,
                             0,
                             VectorXd::Constant(n, kNone),
                             VectorXd::Constant(n, kNone),
                             tracks.size() - 1,
                             0,
                             kNone};
    for (Index t = 0; t < n; ++t) {
      if (!(inverse[t] > 0.0)) continue;
      inertia.value[t] = p[kYawInertia] / inverse[t];
      inertia.sd[t] = inertia.value[t] * course.sd(0, t) / inverse[t];
    }
    inertia.scale = -inertia.value[n - 1] / inverse[n - 1];
    tracked.push_back(std::move(inertia));
  }

  // In the order of the model file.
  for (TrackedParameter& each : tracked) {
    const auto k = std::find(unknowns.free.begin(), unknowns.free.end(), each.parameter) -
                   unknowns.free.begin();
    each.position = unknowns.position[static_cast<std::size_t>(k)];
  }
  std::sort(tracked.begin(), tracked.end(),
            [](const auto& one, const auto& other) { return one.position < other.position; });
  const auto count = static_cast<Index>(tracked.size());
  Course& course = estimate.course.emplace();
  course.mean.resize(count, n);
  course.sd.resize(count, n);
  std::string held;
  for (std::size_t i = 0; i < estimate.parameters.size(); ++i) {
    EstimatedParameter& reported = estimate.parameters[i];
    const auto hit = std::find_if(tracked.begin(), tracked.end(),
                                  [i](const auto& each) { return each.position == i; });
    if (hit == tracked.end()) {
      if (!reported.fixed) held += (held.empty() ? "" : ", ") + reported.name;
      reported.fixed = true;
      continue;
    }
    const auto k = static_cast<Index>(hit - tracked.begin());
    const double unit = unit_scale(reported.unit);
    course.names.push_back(reported.name);
    course.units.push_back(reported.unit);
    course.mean.row(k) = hit->value.transpose() / unit;
    course.sd.row(k) = hit->sd.transpose() / unit;
    reported.value = course.mean(k, n - 1);
  }
  MatrixXd information = MatrixXd::Zero(count, count), covariance = information;
  for (Index k = 0; k < count; ++k) {
    for (Index l = 0; l < count; ++l) {
      const TrackedParameter &one = tracked[static_cast<std::size_t>(k)],
                             &other = tracked[static_cast<std::size_t>(l)];
      if (one.balance != other.balance) continue;
      const RecursiveLeastSquares& end = tracks[one.balance].course.end;
      const double per_unit = one.scale / unit_scale(course.units[static_cast<std::size_t>(k)]) *
                              other.scale / unit_scale(course.units[static_cast<std::size_t>(l)]);
      const double noise = std::max(1e-30, noise_variance(end)[0]);
      information(k, l) =
          information_of_rows(end)(one.coefficient, other.coefficient) / (noise * per_unit);
      covariance(k, l) =
          inverse_correlation(end)(one.coefficient, other.coefficient) * noise * per_unit;
    }
  }
  judge_parameters(estimate, information, covariance);
  estimate.covariance_kind =
      "the noise at the end times P; bias by noise in the regressors, and for Iz the errors of the "
      "stiffnesses, come on top";

  Series& series = estimate.series;
  series.time = balances.time;
  const auto channels = static_cast<Index>(tracks.size());
  series.measured.resize(channels, n);
  series.predicted = series.standardised = series.measured;
  course.log_alarm = VectorXd::Constant(n, kNone);
  std::vector<RegressionCourse::Change> changes;
  for (Index k = 0; k < channels; ++k) {
    const BalanceTrack& track = tracks[static_cast<std::size_t>(k)];
    report_balance(estimate, track, k);
    estimate.notes.push_back(
        track.channel + ": " +
        describe_forgetting(*forgetting, track.course, !model.regression.forgetting));
    for (Index t = 0; t < n; ++t) {
      course.log_alarm[t] = std::fmax(course.log_alarm[t], track.course.log_alarm[t]);
    }
    changes.insert(changes.end(), track.course.changes.begin(), track.course.changes.end());
  }
  std::sort(changes.begin(), changes.end(),
            [](const auto& one, const auto& other) { return one.found < other.found; });
  course.changes = reported_changes(changes, balances.time, course.mean);
  if (forgetting->reset || forgetting->watch) {
    course.log_threshold = std::log(forgetting->samples_per_false_alarm);
  }
  if (!held.empty()) {
    estimate.notes.push_back("held at the file's value, because only Cf, Cr and Iz are tracked: " +
                             held);
  }
  estimate.warnings.push_back(
      {"tracked_only",
       "note",
       {},
       "recursive least squares follows changes; noise in its regressors biases the values, and no "
       "standard error here knows of that",
       "take values from 'identikal fit'"});
  if (!course.mean.rightCols(1).allFinite()) {
    estimate.status = Status::answer_no;
    estimate.message = "the moment balance gives no positive yaw inertia here";
    return estimate;
  }
  estimate.status = Status::ok;
  estimate.message =
      fmt::format("{} parameter{} tracked over {} means of 0.1 s", count, count == 1 ? "" : "s", n);
  return estimate;
}

}  // namespace identikal
