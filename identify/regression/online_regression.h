// What are the coefficients of a regression now, with the sample that has just come?
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "identify/model/model.h"
#include "lib/data/units.h"
#include "lib/regression/lagged_regressors.h"
#include "lib/regression/recursive_least_squares.h"

namespace identikal {

/// A regression of which nothing is left to be chosen.
struct RegressionSettings {
  RegressionOrder order;
  double delta = 0.0;  ///< P(0) = I / delta
  Forgetting forgetting;
  /// Of the channels, and so of the coefficients; "" in SI.
  std::vector<std::string> input_units;
  std::string output_unit;
};

/// Those of a model file that leaves nothing open.
/// @throws InputError for an order, a forgetting factor or a delta that is to be chosen: that takes
///   a recording (identify/regression/track.h gives what it has chosen)
RegressionSettings regression_settings(const Model& model);

/// Recursive least squares between two samples. Read coefficients, sd and innovation after every
/// step(); the rest is what it remembers.
///
/// Example:
///
///     OnlineRegression online = start_online_regression(regression_settings(model));
///     for (Eigen::Index t = 0; t < y.cols(); ++t) step(online, y(0, t), u.col(t));
///     const Eigen::VectorXd coefficients_now = online.coefficients, sd = online.sd;
struct OnlineRegression {
  /// d: in the channels' units, in the order of lib/regression/lagged_regressors.h; NaN before the
  /// first complete row
  Eigen::VectorXd coefficients, sd;
  /// y minus its prediction by the coefficients before, in SI; NaN where the row is not complete
  double innovation = 0.0;

  OnlineLeastSquares least_squares;
  LagWindow window;
  std::vector<Unit> input_units;
  Unit output_unit;
  Eigen::VectorXd inputs;  ///< m: in the channels' units
};

/// @throws std::invalid_argument for settings out of range
OnlineRegression start_online_regression(const RegressionSettings& settings);

/// Takes a sample. Where a sample that its row reaches is missing, the coefficients stay. Its numbers
/// are those of track_regression() for the whole recording. Allocates nothing.
/// @param y  in SI, NaN = missing  @param u  m, in SI, NaN = missing
/// @return false, and nothing has changed, when one is infinite
/// @throws std::invalid_argument for another number of inputs
bool step(OnlineRegression& online, double y, const Eigen::Ref<const Eigen::VectorXd>& u);

}  // namespace identikal
