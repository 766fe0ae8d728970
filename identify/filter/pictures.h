// What did a Kalman filter's predictions look like, before and after its noise was tuned?
#pragma once

#include <vector>

#include "identify/estimate/results.h"
#include "identify/model/model.h"
#include "lib/data/dataset.h"

namespace identikal {

/// Fills `standardised_before`, `one_step` and `simulation` of the estimate's pictures.
///
/// Before: the filter at the model file's values; empty where that is the estimate. Simulation:
/// from kForecastFrom of each recording on, E[y(t) | y up to there], with its standard deviation; the
/// filter that it goes on from has seen the recording before, as much of it as memory allows. That
/// of a nonlinear model is simulated_outputs() (identify/filter/simulated_fit.h) of the whole
/// recording, without deviation.
///
/// Example:
///
///     picture_filter(model, recordings, estimate);
///     const Eigen::MatrixXd predicted = estimate.pictures.one_step;  // channels x N
///
/// @param model       its parameters at the start
/// @param recordings  those that `estimate.series` shows, in its order
void picture_filter(const Model& model, const std::vector<Dataset>& recordings,
                    FilterEstimate& estimate);

inline constexpr double kForecastFrom = 0.7;  ///< share of a recording

}  // namespace identikal
