// Which innovation model of given modes has given autocovariances of its outputs?
#pragma once

#include <optional>

#include <Eigen/Core>

#include "lib/statistics/autocovariance.h"

namespace identikal {

/// x(t+1) = A x(t) + K e(t), y(t) = C x(t) + e(t), cov e = Sigma.
struct InnovationModel {
  Eigen::MatrixXd K;      ///< n x ny
  Eigen::MatrixXd Sigma;  ///< ny x ny
};

struct AutocovarianceFit {
  Eigen::MatrixXd h;       ///< n x ny: E x(t+1) y(t)' = A P C' + K Sigma
  Autocovariances fitted;  ///< at the same lags; the first is the given one
  double left = 0.0;  ///< sum of squares over the lags from 1 on that is not explained, a share
  /// Nothing: no noise at all makes h and Y_0 of these A and C (they are not positive real).
  std::optional<InnovationModel> innovation;
};

/// The least squares (5.13) of Matisko (2013), sum over l >= 1 of |Y_l - R_l(K, Sigma)|^2 with the
/// R_l of (5.12). As R_l = C A^(l-1) h, K and Sigma enter through h and Y_0 alone: what the
/// source calls non-convex is linear least squares in h. K and Sigma follow from h and Y_0 by the
/// Riccati equation of stochastic realisation (Faurre 1976),
///
///   P = A P A' + K Sigma K',  Sigma = Y_0 - C P C',  K = (h - A P C') Sigma^-1.
///
/// Example:
///
///     const Autocovariances Y = sample_autocovariances(y, 20).value;
///     const AutocovarianceFit fit = fit_autocovariances(model.A, model.C, Y);
///     if (fit.innovation) std::printf("K(1,1) = %g\n", fit.innovation->K(0, 0));
///
/// @param A  n x n, stable
/// @param C  ny x n, observable
/// @param Y  Y_l = E y(t+l) y(t)', lags 0 to M, M >= n
/// @throws std::invalid_argument when shapes disagree or M < n
AutocovarianceFit fit_autocovariances(const Eigen::Ref<const Eigen::MatrixXd>& A,
                                      const Eigen::Ref<const Eigen::MatrixXd>& C,
                                      const Autocovariances& Y);

}  // namespace identikal
