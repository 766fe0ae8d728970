#include "identify/regression/batch.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "identify/estimate/distribution.h"
#include "identify/estimate/test_result.h"
#include "identify/model/check.h"
#include "identify/regression/internal/coefficients.h"
#include "identify/regression/order.h"
#include "identify/regression/track.h"
#include "lib/regression/least_squares.h"
#include "lib/statistics/long_run_covariance.h"
#include "lib/statistics/whiteness.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kWhitenessLevel = 0.01;  // of the whiteness test

// Rows of all recordings, one after the other.
struct AllRows {
  RegressionChoice choice;
  MatrixXd phi;  // d x n
  VectorXd y;
  std::vector<LaggedRows> of;  // each recording
  Index skipped = 0;
};

AllRows rows_of(const Model& model, const std::vector<Dataset>& recordings) {
  AllRows out;
  Index n = 0, d = 0;
  for (const Dataset& data : recordings) {
    check_recording(model, data);
    const MatrixXd u = in_channel_units(data.u, data.inputs);
    const VectorXd y = in_channel_units(data.y, data.outputs).row(0).transpose();
    RegressionModel settings = as_regression(model);
    settings.forgetting = 1.0;
    settings.memory = 0.0;
    if (out.of.empty()) out.choice = choose_regression(settings, u, y, data.name);
    out.of.push_back(lagged_rows(u, y, out.choice.order));
    n += out.of.back().y.size();
    d = out.of.back().phi.rows();
    out.skipped += out.of.back().skipped;
  }
  if (n <= d) {
    throw InputError({recordings[0].name, 0, 0},
                     fmt::format("{} complete rows for {} coefficients", n, d),
                     "more rows than coefficients");
  }
  out.phi.resize(d, n);
  out.y.resize(n);
  Index at = 0;
  for (const LaggedRows& rows : out.of) {
    out.phi.middleCols(at, rows.y.size()) = rows.phi;
    out.y.segment(at, rows.y.size()) = rows.y;
    at += rows.y.size();
  }
  return out;
}

// Of coefficients whose scores phi e are correlated in time; never below that of white errors.
MatrixXd coloured_covariance(const MatrixXd& phi, const VectorXd& e, const MatrixXd& P,
                             double variance) {
  const MatrixXd scores = P * (phi * e.asDiagonal());
  Index bandwidth = 1;
  const MatrixXd wide = widest_long_run_covariance(scores, variance * P, bandwidth);
  const VectorXd by =
      (variance * P.diagonal().array() / wide.diagonal().array().max(1e-300)).max(1.0).sqrt();
  return by.asDiagonal() * wide * by.asDiagonal();
}

void report_rows(RegressionEstimate& estimate, const std::vector<Dataset>& recordings,
                 const AllRows& rows, const VectorXd& e, double sd) {
  const auto n = e.size();
  Series& series = estimate.series;
  const Channel& output = recordings[0].outputs[0];
  series.channels = {output.name};
  series.units = {output.unit};
  series.time.resize(n);
  series.measured = rows.y.transpose();
  series.predicted = (rows.y - e).transpose();
  series.standardised = e.transpose() / (sd > 0.0 ? sd : 1.0);
  Index at = 0;
  for (std::size_t r = 0; r < recordings.size(); ++r) {
    for (const Index sample : rows.of[r].sample) {
      if (recordings.size() > 1) series.recording.push_back(static_cast<int>(r) + 1);
      series.time[at++] = recordings[r].time[sample];
    }
    estimate.inputs.push_back({recordings[r].name, "", static_cast<long>(recordings[r].size()),
                               static_cast<long>(rows.of[r].sample.size())});
  }
  estimate.one_step.push_back(one_step_fit(output.name, output.unit, rows.y, e));
}

Findings check_errors(const RegressionEstimate& estimate, bool coloured, bool feedback) {
  Findings out;
  const std::vector<std::string> open = not_determined(estimate);
  if (!open.empty()) {
    out.push_back(make_finding(
        FindingCode::not_identifiable, open,
        fmt::format("the recordings do not determine {} separately", fmt::join(open, ", "))));
  }
  if (!coloured) return out;
  const char* const remedy =
      "the model lacks something: another order or input, an offset, a delay; 'model --as armax' "
      "or "
      "'--as oe' have a noise of their own";
  if (feedback) {
    out.push_back({FindingCode::coloured_innovations,
                   Severity::serious,
                   {},
                   "errors are correlated over time, and the output before is a regressor: the "
                   "coefficients are biased",
                   remedy});
  } else {
    out.push_back(make_finding(FindingCode::coloured_errors, {},
                               "errors are correlated over time; standard errors allow for that",
                               remedy));
  }
  return out;
}

}  // namespace

ResultSections sections_of(const RegressionEstimate& result) {
  ResultSections out{&result};
  out.fit = &result;
  out.tests = &result.tests;
  return out;
}

RegressionEstimate fit_regression(const Model& model, const std::vector<Dataset>& recordings) {
  const AllRows rows = rows_of(model, recordings);
  const LinearLeastSquares fit = least_squares(rows.phi.transpose(), rows.y);
  const VectorXd e = fit.residuals.col(0);
  const double variance = fit.noise_variance[0];
  const auto freedom = static_cast<double>(rows.y.size() - fit.rank);

  RegressionEstimate estimate;
  estimate.verb = "fit";
  estimate.model_name = model.name;
  estimate.objective.method = "least squares";
  estimate.objective.samples = static_cast<long>(rows.y.size());
  const Channel& output = recordings[0].outputs[0];
  list_coefficients(estimate, recordings[0], rows.choice.order, fit.theta.col(0));
  estimate.tests.push_back(
      ljung_box_test(output.name, ljung_box(e, default_lags(e.size())), kWhitenessLevel));
  const bool coloured = !estimate.tests.back().pass;
  const MatrixXd information = rows.phi * rows.phi.transpose() / (variance > 0.0 ? variance : 1.0);
  judge_parameters(
      estimate, information,
      coloured ? coloured_covariance(rows.phi, e, fit.P, variance) : MatrixXd(variance * fit.P),
      student_t_quantile(0.975, freedom));
  estimate.covariance_freedom = freedom;
  estimate.covariance_kind = coloured ? "least squares, correlated errors allowed for"
                                      : "least squares, errors independent";
  report_rows(estimate, recordings, rows, e, std::sqrt(variance));
  estimate.derived = {
      {"inputs", "samples", static_cast<double>(rows.choice.order.inputs), kNone},
      {"feedback", "samples", static_cast<double>(rows.choice.order.feedback), kNone},
      {"sd of the error", output.unit, std::sqrt(variance), kNone}};
  if (rows.skipped > 0) {
    estimate.notes.push_back(
        fmt::format("{} samples left out: one of theirs or before is missing", rows.skipped));
  }
  append(estimate.findings, check_errors(estimate, coloured, rows.choice.order.feedback > 0));
  conclude(estimate,
           fmt::format("{} coefficients from {} rows", estimate.parameters.size(), rows.y.size()));
  return estimate;
}

}  // namespace identikal
