// How much does a sum scatter whose terms are correlated in time?
#pragma once

#include <Eigen/Core>

namespace identikal {

/// Covariance of the sum over t of x_t, from autocovariances under a triangular (Bartlett) window:
///   sum_t x_t x_t' + sum_(l=1)^(bandwidth-1) (1 - l/bandwidth) sum_t (x_t x_(t+l)' + x_(t+l)
///   x_t').
/// Always positive semidefinite (Newey & West 1987). bandwidth = 1 stands for uncorrelated terms.
///
/// Example:
///
///     const Eigen::Index bandwidth = andrews_bandwidth(e, e.cols() / 8);
///     const Eigen::MatrixXd of_sum = long_run_covariance(e, bandwidth);
///     const Eigen::MatrixXd of_mean = of_sum / double(e.cols() * e.cols());
///
/// @param terms  k x N, mean zero
/// @throws std::invalid_argument for a bandwidth below 1
Eigen::MatrixXd long_run_covariance(const Eigen::Ref<const Eigen::MatrixXd>& terms,
                                    Eigen::Index bandwidth);

/// Bandwidth for it that suits the data: Andrews (1991), eq (6.2) and (6.4), a first-order
/// autoregression fitted to every row, rows weighted by the inverse of their variance. Between 1
/// and `largest`. Terms as above.
Eigen::Index andrews_bandwidth(const Eigen::Ref<const Eigen::MatrixXd>& terms,
                               Eigen::Index largest);

/// The covariance above at Andrews' bandwidth or a multiple of it up to an eighth of the terms,
/// whichever is widest against `white` on average over the rows: his rule looks at neighbouring terms
/// only, and misses what is slow under fast noise.
/// @param white      k x k: the covariance that terms have if they are uncorrelated
/// @param bandwidth  written: the one taken
Eigen::MatrixXd widest_long_run_covariance(const Eigen::Ref<const Eigen::MatrixXd>& terms,
                                           const Eigen::Ref<const Eigen::MatrixXd>& white,
                                           Eigen::Index& bandwidth);

}  // namespace identikal
