#include "identify/regression/track.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "identify/model/check.h"
#include "identify/regression/internal/coefficients.h"
#include "identify/regression/order.h"
#include "lib/data/units.h"
#include "lib/regression/lagged_regressors.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// At every sample of the recording; between rows nothing changes.
void report_course(TrackedCoefficients& estimate, const Dataset& recording, const LaggedRows& rows,
                   const Forgetting& forgetting, const RegressionHistory& course) {
  TimeHistory& out = estimate.time_history;
  for (const EstimatedParameter& p : estimate.parameters) {
    out.names.push_back(p.name);
    out.units.push_back(p.unit);
  }
  const Index N = recording.size(), d = course.theta.rows();
  out.mean = out.sd = MatrixXd::Constant(d, N, kNone);
  out.log_alarm = VectorXd::Constant(N, kNone);
  Series& series = estimate.series;
  series.time = recording.time;
  series.channels = {recording.outputs[0].name};
  series.units = {recording.outputs[0].unit};
  series.measured = in_channel_units(recording.y, recording.outputs);
  series.predicted = series.standardised = MatrixXd::Constant(1, N, kNone);
  std::size_t k = 0;
  for (Index t = 0; t < N; ++t) {
    if (t > 0) {
      out.mean.col(t) = out.mean.col(t - 1);
      out.sd.col(t) = out.sd.col(t - 1);
    }
    if (k == rows.sample.size() || rows.sample[k] != t) continue;
    const auto row = static_cast<Index>(k++);
    out.mean.col(t) = course.theta.col(row);
    out.sd.col(t) = course.sd.col(row);
    out.log_alarm[t] = course.log_alarm[row];
    series.predicted(0, t) = rows.y[row] - course.prior_error[row];
    series.standardised(0, t) = course.standardised[row];
  }
  VectorXd time(rows.y.size());
  for (Index row = 0; row < time.size(); ++row) {
    time[row] = recording.time[rows.sample[row]];
  }
  out.changes = reported_changes(course.changes, time, course.theta);
  if (forgetting.reset || forgetting.watch) {
    out.log_threshold = std::log(forgetting.samples_per_false_alarm);
  }
}

RegressionSettings settings_used(const RegressionChoice& choice, const Forgetting& forgetting,
                                 const Dataset& recording) {
  RegressionSettings out{choice.order, choice.delta, forgetting, {}, recording.outputs[0].unit};
  for (const Channel& input : recording.inputs) out.input_units.push_back(input.unit);
  return out;
}

/// What stands against the course: coefficients that are open, a choice that was not finished.
Findings check_course(const TrackedCoefficients& estimate, const RegressionChoice& choice) {
  Findings out;
  const std::vector<std::string> open = not_determined(estimate);
  if (!open.empty()) {
    out.push_back(make_finding(
        FindingCode::not_identifiable, open,
        fmt::format("this recording does not determine {} separately", fmt::join(open, ", "))));
  }
  if (choice.stopped) {
    out.push_back(
        make_finding(FindingCode::stopped, {},
                     fmt::format("stopped by the caller, {} orders tried", choice.candidates)));
  }
  return out;
}

}  // namespace

ChannelFit one_step_fit(const std::string& channel, const std::string& unit, const VectorXd& y,
                        const VectorXd& error) {
  ChannelFit fit;
  fit.channel = channel;
  fit.unit = unit;
  fit.fit_percent = fit_percent(y, error);
  fit.rmse = error.norm() / std::sqrt(static_cast<double>(y.size()));
  return fit;
}

std::vector<TimeHistory::Change> reported_changes(
    const std::vector<RegressionHistory::Change>& changes, const VectorXd& time,
    const MatrixXd& estimates) {
  std::vector<TimeHistory::Change> out;
  for (std::size_t c = 0; c < changes.size(); ++c) {
    const Index end = c + 1 < changes.size() ? changes[c + 1].found : estimates.cols();
    out.push_back({time[changes[c].since], time[changes[c].found],
                   estimates.col(std::max<Index>(changes[c].found - 1, 0)),
                   estimates.col(std::max<Index>(end - 1, 0))});
  }
  return out;
}

Findings check_regression(const VectorXd& standardised, bool shortest) {
  Findings out;
  constexpr double kCorrelated = 0.2, kDeviations = 4.0;
  double product = 0.0, squares = 0.0;
  Index n = 0;
  for (Index t = 1; t < standardised.size(); ++t) {
    if (!std::isfinite(standardised[t]) || !std::isfinite(standardised[t - 1])) continue;
    product += standardised[t] * standardised[t - 1];
    squares += standardised[t] * standardised[t];
    ++n;
  }
  const double r = squares > 0.0 ? product / squares : 0.0;
  if (std::abs(r) > kCorrelated && std::abs(r) * std::sqrt(static_cast<double>(n)) > kDeviations) {
    out.push_back(make_finding(
        FindingCode::coloured_errors, {},
        fmt::format("errors are correlated with the ones before ({:.2f}): standard errors, the "
                    "choice of the memory and the rate of false alarms suppose that they are not",
                    r),
        "the model lacks something: another order or input, an offset, a delay"));
  }
  if (shortest) {
    out.push_back(make_finding(
        FindingCode::short_memory, {},
        "of all memories tried the shortest predicts best: there is no telling coefficients that "
        "change from errors that are followed",
        "give forgetting in the model file"));
  }
  return out;
}

Forgetting forgetting_of(const RegressionModel& settings, double lambda) {
  Forgetting out;
  out.factor = settings.forgetting.value_or(lambda);
  out.memory = settings.memory;
  out.reset = settings.reset;
  out.watch = settings.memory > 0.0;
  return out;
}

std::string describe_forgetting(const Forgetting& forgetting, const RegressionHistory& course,
                                bool chosen) {
  std::string out;
  if (forgetting.memory > 0.0) {
    out = fmt::format("forgetting variable: memory {:.4g} samples, factor {:.4g} to {:.4g}",
                      forgetting.memory, course.lambda.minCoeff(), course.lambda.maxCoeff());
  } else {
    out = fmt::format("forgetting {:.6g}{}", forgetting.factor, chosen ? " (chosen)" : "");
    if (forgetting.factor < 1.0) {
      out += fmt::format(", a memory of {:.3g} samples", 1.0 / (1.0 - forgetting.factor));
    }
  }
  if (!forgetting.reset && !forgetting.watch) return out;
  return out + fmt::format(
                   "; {} change{} found{}, one false alarm in {:.3g} samples or more",
                   course.changes.size(), course.changes.size() == 1 ? "" : "s",
                   forgetting.reset && !course.changes.empty() ? " and the past dropped there" : "",
                   forgetting.samples_per_false_alarm);
}

TrackedCoefficients track_regression(const Model& model, const Dataset& recording,
                                     const std::function<bool(const std::string&)>& progress,
                                     RegressionSettings* used) {
  check_recording(model, recording);
  const MatrixXd u = in_channel_units(recording.u, recording.inputs);
  const VectorXd y = in_channel_units(recording.y, recording.outputs).row(0).transpose();
  const RegressionChoice choice = choose_regression(
      as_regression(model), u, y, recording.name, [&](const RegressionOrder& order) {
        return !progress || progress(fmt::format("order {} of the inputs, {} of the feedback",
                                                 order.inputs, order.feedback));
      });
  const LaggedRows rows = lagged_rows(u, y, choice.order);
  const Forgetting forgetting = forgetting_of(as_regression(model), choice.forgetting);
  if (used != nullptr) *used = settings_used(choice, forgetting, recording);
  const RegressionHistory course =
      run_recursive_least_squares(rows.phi, rows.y, choice.delta, forgetting);

  TrackedCoefficients estimate;
  estimate.verb = "track";
  estimate.model_name = model.name;
  estimate.objective.method = "recursive least squares";
  estimate.inputs.push_back({recording.name, "", static_cast<long>(recording.size()),
                             static_cast<long>(rows.sample.size())});
  list_coefficients(estimate, recording, choice.order, course.theta.rightCols(1));
  const double noise = noise_variance(course.end)[0];
  const bool noisy = noise > 0.0;
  const MatrixXd information = information_of_rows(course.end);
  judge_parameters(estimate, noisy ? MatrixXd(information / noise) : information,
                   noisy ? MatrixXd(noise * inverse_correlation(course.end))
                         : MatrixXd::Zero(information.rows(), information.cols()));
  estimate.covariance_kind =
      "the noise at the end times P; for coefficients that drift, too large if they do not";
  report_course(estimate, recording, rows, forgetting, course);

  const std::string& unit = recording.outputs[0].unit;
  estimate.one_step.push_back(
      one_step_fit(recording.outputs[0].name, unit, rows.y, course.prior_error));
  estimate.derived = {{"inputs", "samples", static_cast<double>(choice.order.inputs), kNone},
                      {"feedback", "samples", static_cast<double>(choice.order.feedback), kNone},
                      {"forgetting", "", course.lambda.mean(), kNone},
                      {"delta", "", choice.delta, kNone},
                      {"sd of the error", unit, std::sqrt(noise), kNone}};

  estimate.notes.push_back(describe_forgetting(forgetting, course, choice.forgetting_chosen));
  if (choice.order_chosen) {
    estimate.notes.push_back(fmt::format(
        "order chosen among {}, up to {} of the inputs and {} of the feedback, by the squared "
        "errors of predictions made before each of {} samples: rms {:.4g} {}",
        choice.candidates, choice.longest.inputs, choice.longest.feedback, choice.counted,
        std::sqrt(choice.criterion / static_cast<double>(choice.counted)), unit));
  }
  if (rows.skipped > 0) {
    estimate.notes.push_back(
        fmt::format("{} samples left out: one of theirs or before is missing", rows.skipped));
  }
  if (choice.order.feedback > 0) {
    // What the output before predicts without any model.
    const VectorXd before = rows.phi.row(u.rows() * choice.order.inputs).transpose();
    estimate.notes.push_back(
        fmt::format("the output before, taken as the prediction, fits {:.2f} %: a high one-step "
                    "fit is little evidence for the coefficients",
                    fit_percent(rows.y, rows.y - before)));
  }
  append(
      estimate.findings,
      check_regression(course.standardised,
                       choice.forgetting_chosen && choice.forgetting < 1.0 &&
                           choice.forgetting <= least_forgetting(rows.phi.rows()) * (1.0 + 1e-6)));
  append(estimate.findings, check_course(estimate, choice));
  conclude(estimate, fmt::format("{} coefficients tracked over {} samples",
                                 estimate.parameters.size(), rows.y.size()));
  return estimate;
}

}  // namespace identikal
