// How do the coefficients of a regression change along a recording?
#pragma once

#include <functional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "identify/estimate/results.h"
#include "identify/model/model_file.h"
#include "identify/regression/online_regression.h"
#include "lib/data/dataset.h"
#include "lib/regression/recursive_least_squares.h"

namespace identikal {

/// Recursive least squares of the output on present and past inputs and past outputs
/// (lib/regression/lagged_regressors.h) over a recording on a uniform sampling grid, in the units
/// of the model's channels: coefficients, their errors and delta are what they would be of the
/// file's columns. What the model leaves open is chosen first (identify/regression/order.h).
/// Samples whose regressors are not complete are left out, and the coefficients stay meanwhile.
///
/// Example:
///
///     const auto course = track_regression(model, recordings[0]);  // of a regression
///
/// @param used  where it is not null: receives what was given or chosen
/// @throws InputError when there are too few complete samples
TrackedCoefficients track_regression(const Model& model, const Dataset& recording,
                                     const std::function<bool(const std::string&)>& progress = {},
                                     RegressionSettings* used = nullptr);

/// Text for the console on how the past was forgotten, shared by all that track coefficients.
std::string describe_forgetting(const Forgetting& forgetting, const RegressionHistory& course,
                                bool chosen);

/// Fit of predictions made before each sample, from their errors.
ChannelFit one_step_fit(const std::string& channel, const std::string& unit,
                        const Eigen::VectorXd& y, const Eigen::VectorXd& error);

/// Changes in words of time and of the estimates around them.
/// @param changes    in the order in which they were found
/// @param time       n [s], of each row
/// @param estimates  names x n
std::vector<TimeHistory::Change> reported_changes(
    const std::vector<RegressionHistory::Change>& changes, const Eigen::VectorXd& time,
    const Eigen::MatrixXd& estimates);

/// Where what recursive least squares relies on does not hold: errors that are correlated
/// from one sample to the next, and a chosen memory that is the shortest allowed.
/// @param standardised  n: of the predictions' errors
Findings check_regression(const Eigen::VectorXd& standardised, bool shortest);

/// As the settings have it; lambda where they do not.
Forgetting forgetting_of(const RegressionModel& settings, double lambda);

}  // namespace identikal
