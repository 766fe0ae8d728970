// How does a sequence correlate with its own past? The sample autocorrelation in its four usual
// normalisations.
#pragma once

#include <Eigen/Core>

#include "lib/statistics/autocovariance.h"

namespace identikal {

/// What the sum of the products of N - k pairs is divided by.
enum class Divisor {
  pairs,           ///< N - k: unbiased, (3.3)
  samples,         ///< N: biased, always positive definite, (3.2)
  equal_variance,  ///< sqrt(N (N - k)): of white noise every lag has variance 1 / N, (3.8), (3.11)
  truncated,       ///< N - M, and only so many pairs are summed at every lag, (3.9)
};

/// Y_k = E e(t+k) e(t)', k = 0 .. lags - 1. About zero: innovations have no mean by hypothesis.
/// Missing samples leave out the pairs they are part of: N - k becomes the number of pairs present
/// of each entry, N that at lag 0.
///
/// Example:
///
///     const Autocovariances Y = sample_autocovariances(e, 21, Divisor::samples);
///     const Autocovariances gamma = autocorrelations(Y);
///     const double next_sample = gamma[1](0, 0);  // of the first channel with itself
///
/// @param e     ny x N, NaN = missing
/// @param lags  >= 1; where there is no pair the value is NaN
/// @throws std::invalid_argument for lags below 1, and with Divisor::truncated for lags > N
/// Source: Matisko (2013), section 3.2, transposed as (4.13) is (its (3.10) has E e(t) e(t+k)'). As
/// printed, (3.9) sums y(i) y(i+k) up to i = N - M + k, beyond the end of the record for k > M/2;
/// y(i) y(i-k) is meant, or the first N - M products.
Autocovariances sample_autocovariances(const Eigen::Ref<const Eigen::MatrixXd>& e,
                                       Eigen::Index lags, Divisor divisor);

/// Gamma_k(i, j) = Y_k(i, j) / sqrt(Y_0(i, i) Y_0(j, j)); NaN where a variance is zero.
/// Source: Matisko (2013), (3.12).
Autocovariances autocorrelations(const Autocovariances& Y);

}  // namespace identikal
