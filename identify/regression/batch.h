// Which coefficients of a regression fit recordings best, all samples at once?
#pragma once

#include <vector>

#include "identify/estimate/results.h"
#include "identify/model/model.h"
#include "lib/data/dataset.h"

namespace identikal {

/// Of fit where the model is a regression.
struct RegressionEstimate : Estimate, RecordingFit {};
ResultSections sections_of(const RegressionEstimate& result);

/// Least squares of the output on present and past inputs and past outputs
/// (lib/regression/lagged_regressors.h, least_squares.h) over recordings on uniform sampling grids,
/// in the units of the model's channels: every sample counts the same, what the model says of
/// forgetting does not count. Orders that it leaves open are chosen from the first recording
/// (identify/regression/order.h). Standard errors allow for errors that are correlated (Newey &
/// West 1987) where a test finds that; with feedback coefficients are biased then, and a finding
/// says so. Samples whose regressors are not complete are left out.
///
/// Example:
///
///     const RegressionEstimate fit = fit_regression(model, recordings);  // of a regression
///     for (const EstimatedParameter& p : fit.parameters) std::printf("%g\n", p.value);
///
/// @throws InputError when there are no more complete samples than coefficients
/// Source: Sladká (2010), chapter 5.
RegressionEstimate fit_regression(const Model& model, const std::vector<Dataset>& recordings);

}  // namespace identikal
