// What are the coefficients of a regression called, and how well does it fit?
#pragma once

#include <vector>

#include <Eigen/Core>

#include "identify/estimate/estimate.h"
#include "lib/data/dataset.h"
#include "lib/regression/lagged_regressors.h"

namespace identikal {

/// Channels as the file has them. @param si  a row each
Eigen::MatrixXd in_channel_units(const Eigen::MatrixXd& si, const std::vector<Channel>& channels);

/// Adds them to the parameters: "steer(t-1)", with unit and value, in the order of lagged_rows().
void list_coefficients(Estimate& estimate, const Dataset& recording, const RegressionOrder& order,
                       const Eigen::VectorXd& theta);

/// 100 (1 - |error| / |y - mean y|); none where y is constant
double fit_percent(const Eigen::VectorXd& y, const Eigen::VectorXd& error);

}  // namespace identikal
