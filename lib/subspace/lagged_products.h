// What do recordings say of every linear prediction from their last samples? Sums of products of samples
// up to so many rows apart: the work on them no longer depends on how long the recordings are.
#pragma once

#include <vector>

#include <Eigen/Core>

namespace identikal {

/// G = sum over t of w_t w_t', w_t = [z_t; z_(t-1); ...; z_(t-L); x_(t-L)], z = [y; u], over all rows t whose window of
/// L+1 rows has no missing sample and lies within one recording. x is empty, or what a predictor has made of all
/// that was before the window: then nothing is cut off.
struct LaggedProducts {
  Eigen::Index outputs = 0;  ///< p
  Eigen::Index inputs = 0;   ///< m
  Eigen::Index lags = 0;     ///< L
  Eigen::Index states = 0;   ///< of x
  Eigen::Index windows = 0;  ///< rows t that count
  Eigen::MatrixXd gram;      ///< (L+1)(p+m) + states square, newest block first

  Eigen::Index channels() const { return outputs + inputs; }
};

/// The sums of recordings, in one pass; each costs N L (p+m)^2 products.
///
/// Example:
///
///     const LaggedProducts twenty_lags = lagged_products({y}, {u}, 20);
///     std::printf("%td windows\n", twenty_lags.windows);
///
/// @param y  of every recording p x N, NaN = missing
/// @param u  of every recording m x N, NaN = missing; 0 x N without inputs
/// @param x  of every recording n x N: states before each row; none: empty
/// @throws std::invalid_argument for no recording, other numbers of channels or rows, lags below 1
LaggedProducts lagged_products(const std::vector<Eigen::MatrixXd>& y,
                               const std::vector<Eigen::MatrixXd>& u, Eigen::Index lags,
                               const std::vector<Eigen::MatrixXd>& x = {});

}  // namespace identikal
