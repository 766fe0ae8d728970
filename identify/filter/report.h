// What does a filter with known noise make of recordings? Noise matrices, steady gain, fit,
// whiteness tests, series: the part that every result about a filter shares.
#pragma once

#include <vector>

#include "identify/estimate/results.h"
#include "identify/model/model.h"
#include "lib/data/dataset.h"
#include "lib/filter/kalman.h"
#include "lib/statistics/whiteness.h"

namespace identikal {

/// The model's values do not make a filter for these recordings: says why.
/// @throws InputError always
[[noreturn]] void refuse_filter(const Model& model, const std::vector<Dataset>& recordings,
                                FilterStatus status);

/// Q, R, S and the steady state of the filter.
FilterMatrices filter_matrices(const Model& model, const ParameterSet& parameters);

/// One-step fit, tests and series of innovations that one filter per recording has left. The tests
/// take the recordings together and keep a level of 5 % in all (Bonferroni); no autocorrelation
/// reaches across from one recording to the next.
void report_innovations(FilterEstimate& estimate, const std::vector<Dataset>& recordings,
                        const std::vector<FilterResult>& filters);

/// Runs the filter over every recording, each from the model's initial state, and fills all of the
/// above, the log-likelihood and, of a nonlinear model, the fit of its simulation.
///
/// Example:
///
///     FilterEstimate report;
///     const auto filters = report_filter(report, model, model.parameters, recordings);
///     for (const TestResult& test : report.tests) std::puts(test.id.c_str());
///
/// @return what the filter made of each recording, innovations only
/// @throws InputError when the filter cannot run
std::vector<FilterResult> report_filter(FilterEstimate& estimate, const Model& model,
                                        const ParameterSet& parameters,
                                        const std::vector<Dataset>& recordings);

/// The outputs that are measured, and what filters made of those alone: a pseudo-measurement is no
/// sample of noise, so its innovations test nothing. The filters keep their innovations alone.
std::vector<Channel> measured(const std::vector<Channel>& outputs);
std::vector<FilterResult> of_measured(const std::vector<FilterResult>& filters,
                                      const std::vector<Channel>& outputs);

/// A gap between recordings that no test of so many lags looks across, lags counted in each
/// channel's own samples (lib/statistics/whiteness.h).
Eigen::Index rows_apart(const std::vector<FilterResult>& filters, Eigen::Index lags);

/// Standardised innovations of all recordings, ny x N, with `gap` missing samples between one and
/// the next, so that no test looks across; and the inputs in step with them.
Eigen::MatrixXd side_by_side(const std::vector<FilterResult>& filters, Eigen::Index gap);
Eigen::MatrixXd inputs_side_by_side(const std::vector<Dataset>& recordings, Eigen::Index gap);

/// Do the innovations of each channel follow what the inputs were up to ten samples earlier?
/// input_correlation() (lib/statistics/input_correlation.h) without inputs of the same time: a
/// controller may have made those from this very sample. Its value is NaN where it has none.
/// @return ny; empty without inputs
std::vector<FStatistic> input_tests(const std::vector<Dataset>& recordings,
                                    const std::vector<FilterResult>& filters);

}  // namespace identikal
