// What do inputs up to now and outputs before now say about the output? The rows of that
// regression.
#pragma once

#include <vector>

#include <Eigen/Core>

namespace identikal {

/// How far a regression looks back.
struct RegressionOrder {
  Eigen::Index inputs = 1;    ///< n_u >= 1: samples of every input, the present one counted
  Eigen::Index feedback = 0;  ///< n_y >= 0: samples of the output, from the one before
};

/// The samples that rows look back to, as they arrive.
///
///     LagWindow window = start_lag_window(1, {2, 2});
///     if (take(window, u.col(t), y[t])) step(online, window.phi, y[t]);
struct LagWindow {
  Eigen::VectorXd phi;  ///< d: of the sample taken last, where that row is complete

  RegressionOrder order;
  Eigen::MatrixXd u;  ///< m x inputs of the reach: the newest first; NaN before the first sample
  Eigen::VectorXd y;  ///< 1 + feedback of the reach: the same
};

/// @param channels  m >= 1 inputs
/// @param reach     as lagged_rows() has it; left out: `order` itself
/// @throws std::invalid_argument when an order is out of range
LagWindow start_lag_window(Eigen::Index channels, const RegressionOrder& order,
                           const RegressionOrder& reach);
LagWindow start_lag_window(Eigen::Index channels, const RegressionOrder& order);

/// Takes a sample. Allocates nothing.
/// @param u  m; NaN where missing, as y
/// @return whether its row is complete: phi and y
bool take(LagWindow& window, const Eigen::Ref<const Eigen::VectorXd>& u, double y);

/// y(sample[k]) = phi.col(k)' theta + error
struct LaggedRows {
  Eigen::MatrixXd phi;               ///< d x n
  Eigen::VectorXd y;                 ///< n
  std::vector<Eigen::Index> sample;  ///< n, ascending
  Eigen::Index skipped = 0;          ///< rows that a missing sample has cost
};

/// phi(t) = [u_1(t) .. u_1(t - n_u + 1), u_2(t) .., y(t-1) .. y(t - n_y)], d = m n_u + n_y, for
/// every t whose samples all exist and are finite: from t = max(n_u - 1, n_y) on, and never across
/// a missing one.
///
/// Example:
///
///     const LaggedRows rows = lagged_rows(u, y.row(0), {.inputs = 2, .feedback = 1});
///     const Eigen::VectorXd theta = rows.phi.transpose().colPivHouseholderQr().solve(rows.y);
///
/// @param u      m x N
/// @param y      N
/// @param reach  the longest order whose rows are to be complete too: orders compared on the same
///   rows. Left out: `order` itself
/// @throws std::invalid_argument when shapes disagree or an order is out of range
/// Source: Sladká (2010), (1.1), 9.2.1. The loop there begins at t = n_u (counted from 1) and reads
/// y(0) and before when n_y >= n_u; (1.1) has the inputs of the present sample only.
LaggedRows lagged_rows(const Eigen::Ref<const Eigen::MatrixXd>& u,
                       const Eigen::Ref<const Eigen::VectorXd>& y, const RegressionOrder& order,
                       const RegressionOrder& reach);
LaggedRows lagged_rows(const Eigen::Ref<const Eigen::MatrixXd>& u,
                       const Eigen::Ref<const Eigen::VectorXd>& y, const RegressionOrder& order);

}  // namespace identikal
