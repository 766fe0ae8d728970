#include "identify/noise/track.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "identify/estimate/parameter_table.h"
#include "identify/filter/outliers.h"
#include "identify/filter/recordings_check.h"
#include "identify/filter/report.h"
#include "identify/model/check.h"
#include "identify/noise/estimate.h"
#include "lib/base/constants.h"
#include "lib/base/error.h"
#include "lib/statistics/sequential_probability_ratio.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// The same with the first samples alone.
void shorten(NoiseTrack& track, Index samples) {
  for (MatrixXd* each : {&track.mean, &track.sd, &track.filter.x_pred, &track.filter.e,
                         &track.filter.standardised}) {
    *each = each->leftCols(samples).eval();
  }
  track.log_alarm = track.log_alarm.head(samples).eval();
}

// Columns of the samples that do not determine the state yet are as the tracker has them then.
NoiseTrack empty_track(const NoiseTracker& tracker, Index N, double log_threshold) {
  const Index n = tracker.model().states(), ny = tracker.model().outputs();
  NoiseTrack out;
  out.mean.resize(tracker.now().mean.size(), N);
  out.sd.resize(tracker.now().mean.size(), N);
  out.log_alarm = VectorXd::Constant(N, -kInfinity);
  out.log_threshold = log_threshold;
  out.filter.x_pred = MatrixXd::Zero(n, N);
  out.filter.e = MatrixXd::Constant(ny, N, kNone);
  out.filter.standardised = out.filter.e;
  return out;
}

void store(NoiseTrack& out, Index t, const NoiseTrackSample& now) {
  out.mean.col(t) = now.mean;
  out.sd.col(t) = now.sd;
  out.log_alarm[t] = now.log_alarm;
  if (now.change) out.changes.push_back(*now.change);
  out.filter.x_pred.col(t) = now.x_pred;
  out.filter.P_pred.push_back(now.P_pred);
  out.filter.Sigma.push_back(now.Sigma);
  out.filter.e.col(t) = now.e;
  out.filter.standardised.col(t) = now.standardised;
  out.filter.log_likelihood += now.log_density;
}

// What all noise needs: a filter of the file's that runs over the whole recording.
void refuse_where_no_filter_runs(const Model& model, const Dataset& recording, const MatrixXd& u) {
  const LinearModel& linear = as_linear(model);
  const FilterResult filter = kalman_filter(instantiate(linear, model.parameters), linear.initial,
                                            recording.y, u, Keep::innovations);
  if (filter.status != FilterStatus::ok) refuse_filter(model, {recording}, filter.status);
}

}  // namespace

NoiseTrack track_noise(const Model& model, const Dataset& recording,
                       const NoiseTrackOptions& options) {
  const MatrixXd u = model_inputs(as_linear(model), recording.u);
  refuse_where_no_filter_runs(model, recording, u);
  NoiseTracker tracker(model, options);
  const Index N = recording.size();
  NoiseTrack out = empty_track(tracker, N, std::log(options.samples_per_false_alarm));
  Index taken = 0;
  bool stopped = false;  // by the caller
  while (taken < N && !stopped) {
    const bool determined = tracker.lead().has_value();
    if (!tracker.step(recording.y.col(taken), u.col(taken))) {
      refuse_filter(model, {recording}, FilterStatus::indefinite);
    }
    store(out, taken++, tracker.now());
    stopped = determined && options.progress && !options.progress(taken, N);
  }
  if (!tracker.lead()) refuse_filter(model, {recording}, FilterStatus::undetermined);
  out.filter.first_proper = *tracker.lead();
  if (stopped) shorten(out, taken);
  out.posterior = tracker.posterior();
  out.posterior.log_evidence = out.filter.log_likelihood;
  out.posterior.summary.termination = stopped ? Termination::stopped : Termination::converged;
  if (stopped) {
    out.posterior.summary.message =
        fmt::format("stopped by the caller after {} of {} samples", taken, N);
  }
  return out;
}

namespace {

// What Wald's sequential test says of the innovations along the way, decision after decision.
void report_whiteness(TrackedNoise& estimate, const FilterResult& filter) {
  SequentialProbabilityRatio test =
      start_sequential_probability_ratio(filter.standardised.rows(), {});
  int white = 0, coloured = 0;
  for (Index t = filter.first_proper; t < filter.standardised.cols(); ++t) {
    const SequentialDecision decision = update(test, filter.standardised.col(t));
    white += decision == SequentialDecision::white;
    coloured += decision == SequentialDecision::coloured;
  }
  estimate.notes.push_back(
      white + coloured == 0
          ? "the sequential test of whiteness has come to no decision"
          : fmt::format("sequential test of whiteness: {} times white, {} times coloured", white,
                        coloured));
}

// Innovations that are not as large as the filter takes them for, all along the recording.
Findings check_size(const TrackedNoise& estimate, bool adaptive) {
  Findings out;
  constexpr Index kEnough = 50;  // below, a mixture of filters has no chi-square
  for (const TestResult& test : estimate.tests) {
    if (test.id != "nis" || test.pass || estimate.series.time.size() < kEnough) continue;
    out.push_back(make_finding(
        FindingCode::innovation_size, {},
        fmt::format("the innovations are {:.3g} times as large (in variance) as the filter "
                    "predicts",
                    test.value),
        adaptive ? "the first samples of every new noise are among them; else widen the priors"
                 : "noise that changes during the recording: --adaptive; else widen the priors"));
  }
  return out;
}

}  // namespace

TrackedNoise track(const Model& given, const Dataset& whole, const NoiseTrackOptions& options) {
  refuse_constraints(given, "track");
  const Model model = checked(given, {whole});
  check_recordings(model, {whole});
  const NoiseTrack course = track_noise(model, whole, options);
  const bool stopped = course.posterior.summary.termination == Termination::stopped;
  const Dataset recording = stopped ? first_samples(whole, course.mean.cols()) : whole;
  TrackedNoise estimate;
  estimate.model_name = model.name;
  estimate.objective.method = options.adaptive ? "adaptive" : "recursive";
  estimate.objective.log_likelihood = course.filter.log_likelihood;
  const PosteriorPoints& points = course.posterior;
  const bool learnt = points.coordinates.rows() > 0;
  if (learnt) {
    estimate.posterior = report_posterior(estimate, model, points, "recursive Monte Carlo");
    append(estimate.findings, check_priors(estimate, *estimate.posterior));
  } else {
    list_parameters(estimate, model.parameters, model.parameters);
    estimate.covariance_kind = "none: the noise of the model file was not rejected";
  }
  append(estimate.findings, check_length(static_cast<long>(samples_present({recording})),
                                         static_cast<double>(points.coordinates.rows())));
  if (points.left_behind > 0) {
    estimate.findings.push_back(make_finding(
        FindingCode::draws_left_behind, {},
        fmt::format("the recording holds samples that no noise near the draws explains: they could "
                    "not follow {} time{}",
                    points.left_behind, points.left_behind == 1 ? "" : "s"),
        "look for mistakes of a sensor; correct the model if its outputs run away"));
  }
  SolverSummary summary = points.summary;
  summary.termination = Termination::converged;  // what was learnt up to there stands
  const std::string more =
      learnt && options.adaptive
          ? fmt::format("; the noise was re-estimated {} time{}", course.changes.size(),
                        course.changes.size() == 1 ? "" : "s")
          : "";
  append(estimate.findings, check_search(estimate, summary, more));
  if (stopped) {
    estimate.findings.push_back(make_finding(FindingCode::stopped, {}, points.summary.message));
  }
  const ParameterSet end = with_entries(model.parameters, points.entries * points.weight);
  static_cast<FilterMatrices&>(estimate) = filter_matrices(model, end);
  report_innovations(estimate, {recording}, {course.filter});
  report_whiteness(estimate, course.filter);
  append(estimate.findings, check_innovations(estimate));
  append(estimate.findings, check_size(estimate, options.adaptive));
  if (course.changes.empty()) {
    append(estimate.findings, check_outliers_and_offset(model, end, {recording}, {course.filter}));
  }
  conclude(estimate, learnt ? "converged" + more
                            : fmt::format("the noise of the model file stands after {} samples",
                                          recording.size()));

  TimeHistory& report = estimate.time_history;
  const Index k = course.mean.rows();
  VectorXd unit(k);
  for (const EstimatedParameter& p : estimate.parameters) {
    if (p.fixed) continue;
    unit[static_cast<Index>(report.names.size())] = unit_scale(p.unit);
    report.names.push_back(p.name);
    report.units.push_back(p.unit);
  }
  const VectorXd in_units = unit.cwiseInverse();
  report.mean = in_units.asDiagonal() * course.mean;
  report.sd = in_units.asDiagonal() * course.sd;
  report.log_alarm = VectorXd::Constant(recording.size(), kNone);
  if (options.adaptive) {
    report.log_alarm.tail(recording.size() - course.filter.first_proper) =
        course.log_alarm.tail(recording.size() - course.filter.first_proper);
    report.log_threshold = course.log_threshold;
  }
  for (std::size_t c = 0; c < course.changes.size(); ++c) {
    const NoiseChange& change = course.changes[c];
    const Index last =
        c + 1 < course.changes.size() ? course.changes[c + 1].found - 1 : recording.size() - 1;
    report.changes.push_back({recording.time[change.since], recording.time[change.found],
                              report.mean.col(std::max<Index>(change.found - 1, 0)),
                              report.mean.col(last)});
  }
  return estimate;
}

}  // namespace identikal
