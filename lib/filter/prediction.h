// How far off are a filter's predictions several steps ahead?
#pragma once

#include <vector>

#include <Eigen/Core>

#include "lib/model/linear_model.h"
#include "lib/model/state_space.h"

namespace identikal {

/// Sums over samples, so that recordings add up; ny x horizons.
struct PredictionErrors {
  Eigen::MatrixXd squares;  ///< of y(t + h - 1) - E[y(t + h - 1) | y up to t - 1]
  Eigen::MatrixXd count;    ///< measured samples that went in

  Eigen::MatrixXd rms() const { return squares.cwiseQuotient(count).cwiseSqrt(); }
};

/// Predictions from every t >= from behind a diffuse start, with the inputs that were.
///
/// Example:
///
///     const auto errors = prediction_errors(model, InitialState::diffuse, y, u, {1, 5, 20}, 10);
///     const Eigen::MatrixXd rms = errors.rms();  // outputs x 3
///
/// @param y         ny x N, NaN = missing
/// @param u         nu x N
/// @param horizons  h >= 1, rising: 1 is the innovation
/// @return sums of zero when the filter does not run
/// @throws std::invalid_argument as kalman_filter()
PredictionErrors prediction_errors(const StateSpace& model, InitialState initial,
                                   const Eigen::Ref<const Eigen::MatrixXd>& y,
                                   const Eigen::Ref<const Eigen::MatrixXd>& u,
                                   const std::vector<int>& horizons, Eigen::Index from);

}  // namespace identikal
