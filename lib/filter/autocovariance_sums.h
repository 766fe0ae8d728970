// Sample autocovariances without their divisor, by whichever way is cheaper.
#pragma once

#include <vector>

#include <Eigen/Core>

namespace identikal {

/// sum_t z(t+m) z(t)', m = 0 .. lags - 1, each channels x channels. Few lags product by product
/// (lib/filter/internal/segment_autocovariances.h); many by the fast Fourier transform of pieces
/// that fit the cache, whose rounding is 1e-15 of the power at lag 0.
///
/// Example:
///
///     const auto sums = autocovariance_sums(e, 20);
///     const Eigen::MatrixXd variance = sums[0] / e.cols(), next = sums[1] / (e.cols() - 1.0);
///
/// @param z  channels x N, finite
/// @param lags  any; zero from lag N on
std::vector<Eigen::MatrixXd> autocovariance_sums(const Eigen::Ref<const Eigen::MatrixXd>& z,
                                                 Eigen::Index lags);

/// From so many lags on the transform is used.
inline constexpr Eigen::Index kTransformLags = 256;

}  // namespace identikal
