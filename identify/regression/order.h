// How far should a regression look back, and how fast forget?
#pragma once

#include <functional>
#include <string>

#include <Eigen/Core>

#include "identify/model/model.h"
#include "lib/regression/lagged_regressors.h"

namespace identikal {

struct RegressionChoice {
  RegressionOrder order;
  double forgetting = 1.0;
  double delta = 0.0;
  bool order_chosen = false, forgetting_chosen = false;
  double criterion = 0.0;       ///< predictive squares of the winner
  Eigen::Index counted = 0;     ///< errors in it
  Eigen::Index candidates = 0;  ///< orders compared
  RegressionOrder longest;      ///< of those there are to compare
  bool stopped = false;         ///< by the caller, before all were tried
};

/// What the settings leave open, by the predictive least squares criterion (predictive_squares()):
/// the sum of squared errors of predictions made before each sample. It pays for every coefficient
/// too many by itself. All orders are judged on the same samples, from 3 times the longest order's
/// coefficients on, up to the order 5 or what tenfold as many rows as coefficients allow.
///
/// Orders are enumerated, lambda on a grid; then lambda and delta of the chosen order are refined
/// without gradient (solvers/solve.h). What is simpler stands unless something else gains more than
/// 2 in log-likelihood, n/2 log of the ratio of the criteria: lambda = 1, delta a thousandth of the
/// regressors' mean square, and of the orders the one with the fewest coefficients (of several the
/// better) that the best of all does not beat by that. With variable forgetting the orders are
/// judged with lambda = 1 - 1 / memory.
///
/// Example:
///
///     const RegressionChoice choice = choose_regression({}, u, y.row(0), "drive.csv");
///     std::printf("%td samples back, lambda %g\n", choice.order.inputs, choice.forgetting);
///
/// @param u  m x N, y  N: NaN where missing
/// @param progress  called with the order being tried; where it returns false the choice is among
///   those tried before, and not refined
/// @throws InputError, in the name of `data`, when there are too few complete rows
/// Source: Rissanen (1986), IMA J. Math. Control Inform. 3; Wei (1992), Ann. Statist. 20, for
/// consistency.
RegressionChoice choose_regression(
    const RegressionModel& settings, const Eigen::Ref<const Eigen::MatrixXd>& u,
    const Eigen::Ref<const Eigen::VectorXd>& y, const std::string& data,
    const std::function<bool(const RegressionOrder&)>& progress = {});

/// The shortest memory that is tried has 5 samples for each coefficient: below, a regression
/// follows its own errors, which pays where these are correlated and is not informative about the
/// coefficients.
double least_forgetting(Eigen::Index coefficients);

/// The same for lambda alone, over rows that are given: 1, or the minimiser not below `least` where
/// it gains more than 2.
double choose_forgetting(const Eigen::Ref<const Eigen::MatrixXd>& phi,
                         const Eigen::Ref<const Eigen::VectorXd>& y, double delta, double least);

}  // namespace identikal
