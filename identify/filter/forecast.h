// What will the outputs be behind the last row, and between which values?
#pragma once

#include <iosfwd>
#include <optional>

#include <Eigen/Core>

#include "identify/estimate/results.h"
#include "identify/model/model.h"
#include "lib/data/dataset.h"

namespace identikal {

/// Runs the model's filter over a recording and on, behind it, without measurements: what it expects
/// of every output, with the standard deviation of a measurement,
///
///   E[y(N + h) | y(1), ..., y(N)],   sd^2 = C P C' + R,   h = 1 ... rows,
///
/// as the recording has them: in its columns' units, `scale` and `offset` of the model file undone.
/// The parameters count as known. Of a nonlinear model, mean and covariance are the filter's own.
///
/// Example:
///
///     const OutputForecast ahead = forecast(model, recordings[0], 24);
///     const Eigen::VectorXd next = ahead.forecast.mean.col(0);  // as the recording has them
///
/// @param model   with a filter
/// @param rows    how many, at least 1
/// @param future  the inputs of these rows, for a model that has some: its u, as many columns; where
///   samples are irregular, its times too
/// @throws InputError for inputs that are missing, too few or too many, and where the filter cannot
///   run or the recording does not determine a diffuse start
OutputForecast forecast(const Model& model, const Dataset& recording, Eigen::Index rows,
                        const Dataset* future = nullptr);

/// The recording with so many rows behind it, in which nothing is measured: a period apart, or at the
/// future's own times where samples are irregular, with the future's inputs.
/// @throws InputError for inputs that are missing, too few or too many
Dataset with_rows_ahead(const Model& model, const Dataset& recording, Eigen::Index rows,
                        const Dataset* future);

/// Time [s], and of every output its mean, sd, and the two ends of the interval.
void write_forecast_csv(std::ostream& out, const Forecast& forecast);

}  // namespace identikal
