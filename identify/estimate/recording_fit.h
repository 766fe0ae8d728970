// How well does a model describe recordings? Fits, tests, and the series behind them.
#pragma once

#include <array>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "identify/estimate/none.h"
#include "identify/estimate/pictures.h"

namespace identikal {

struct TestResult {
  std::string id;       ///< "nis", "ljung_box", ... (identify/optimality/optimality.h)
  std::string channel;  ///< empty: all together
  double value = kNone;
  std::array<double, 2> interval{kNone, kNone};
  double p = kNone;
  bool pass = true;
  double level = kNone;  ///< how often it may fail an optimal filter; kNone: no part of the verdict
  /// Of the channel's variance, what its own past or earlier inputs explain, beyond what chance
  /// does: how much the failure matters. kNone: no such test.
  double share = kNone;
};

struct ChannelFit {
  std::string channel;
  std::string unit;
  double fit_percent = kNone;  ///< 100 (1 - ||y - yhat|| / ||y - mean y||)
  double rmse = kNone;         ///< in `unit`
};

/// Series behind the result, for residuals.csv; SI converted back to the channel's unit.
struct Series {
  Eigen::VectorXd time;
  std::vector<int> recording;  ///< 1, 2, ... of each sample; empty = there is one
  std::vector<std::string> channels, units;
  Eigen::MatrixXd measured, predicted;  ///< channels x N; NaN where there is none
  Eigen::MatrixXd standardised;         ///< residual / its standard deviation; may be empty
};

/// What 99 % of the rows of a vehicle's drive lie between.
struct DrivenRange {
  std::string quantity;  ///< identify/vehicle/driven_range.h lists them
  std::string unit;
  double low = kNone, high = kNone;
};
/// "vx 13.9 to 16.7 m/s"; of a frequency: "steering frequency up to 0.9 Hz".
///
/// Example:
///
///     const DrivenRange speed{"vx", "m/s", 13.9, 16.7};
///     std::puts(in_words(speed).c_str());
std::string in_words(const DrivenRange& range);

/// How far a filter's estimates of one quantity are from a reference: over all rows where both are
/// known, e = estimate - reference, v = its variance by the filter and the reference's own sd.
struct ReferenceFit {
  std::string name, unit;
  long rows = 0;
  double independent = kNone;  ///< as many independent errors tell as much of nees as these do
  double rmse = kNone, bias = kNone;  ///< root of the mean of e^2, mean of e; in `unit`
  double sd = kNone;                  ///< root of the mean of v, in `unit`
  double nees = kNone;       ///< normalised error squared, mean of e^2 / v: 1 where v is right
  double coverage = kNone;   ///< share of rows with |e| < 1.96 v^1/2: 0.95 where v is right
  double log_score = kNone;  ///< mean log-density of e [nats], `unit` as the unit
};

/// Of the model at the values of the result.
struct RecordingFit {
  std::vector<ChannelFit> one_step, simulation;
  std::vector<ChannelFit> hold_out;           ///< simulation of data that the fit did not see
  std::vector<ChannelFit> hold_out_one_step;  ///< a filter's fit to them
  std::vector<DrivenRange> driven;            ///< of a vehicle; else empty
  std::vector<ReferenceFit> references;       ///< of a filter whose model has some
  std::vector<TestResult> tests;
  Series series;
  Pictures pictures;  ///< filled where a report is requested
};

}  // namespace identikal
