// Which coefficients fit these samples best, all at once, and how many of them do the samples tell?
#pragma once

#include <Eigen/Core>

namespace identikal {

/// Least squares of one or several outputs on the same regressors. Nonlinear least squares:
/// solvers/solve.h, LeastSquares.
struct LinearLeastSquares {
  Eigen::MatrixXd theta;      ///< d x ny
  Eigen::MatrixXd P;          ///< d x d: covariance of theta of output j is noise_variance[j] P
  Eigen::MatrixXd residuals;  ///< N x ny: Y - X theta, not weighted
  Eigen::VectorXd noise_variance;  ///< ny, of a sample of weight 1; NaN when N <= rank
  Eigen::Index rank = 0;           ///< below d: the samples leave combinations open
  Eigen::MatrixXd open;            ///< d x (d - rank): directions of theta that change no residual
};

/// Minimises sum_t w(t) (y(t) - phi(t)' theta)^2 for each output by a rank-revealing orthogonal
/// decomposition of the weighted regressors, columns scaled to length 1 before: the normal
/// equations (5.9) are never formed, which would square the condition. Where the rank is below d,
/// theta is the solution of smallest norm in the scaled coordinates, and P is the covariance of
/// that part of theta alone.
///
/// Example:
///
///     const LinearLeastSquares fit = least_squares(u.transpose(), y.transpose());
///     const Eigen::MatrixXd se = standard_errors(fit);
///     if (fit.rank < u.rows()) std::puts("the samples leave combinations of coefficients open");
///
/// @param X        N x d: row t is phi(t)'
/// @param Y        N x ny
/// @param weights  N, finite and not negative: 1 / variance, up to a factor; left out: all 1
/// @throws std::invalid_argument when shapes disagree, an entry is not finite, or a weight negative
/// Source: Sladká (2010), (5.4), (5.5), (5.14), (5.15).
LinearLeastSquares weighted_least_squares(const Eigen::Ref<const Eigen::MatrixXd>& X,
                                          const Eigen::Ref<const Eigen::MatrixXd>& Y,
                                          const Eigen::Ref<const Eigen::VectorXd>& weights);
LinearLeastSquares least_squares(const Eigen::Ref<const Eigen::MatrixXd>& X,
                                 const Eigen::Ref<const Eigen::MatrixXd>& Y);

/// d x ny: square roots of the diagonals of noise_variance[j] P; NaN for a coefficient that an open
/// direction moves.
Eigen::MatrixXd standard_errors(const LinearLeastSquares& fit);

}  // namespace identikal
