// Is this sequence white? Statistics with their degrees of freedom; p-values are the caller's
// business (identify/distribution.h).
#pragma once

#include <Eigen/Core>

namespace identikal {

/// A statistic that is chi-square distributed with `dof` degrees of freedom when the hypothesis
/// holds.
struct ChiSquareStatistic {
  double value = 0.0;
  double dof = 0.0;
};

/// Autocorrelation of a scalar sequence about its mean at lags 1..lags. Missing samples (NaN) leave
/// out the pairs they are part of: r_k = (n / n_k) sum_t e_t e_(t+k) / sum_t e_t^2 over the n_k
/// pairs present, so that a complete sequence gives the usual (biased) estimate times n / (n - k).
/// @param e     N samples, NaN = missing
/// @param lags  1 <= lags < N
/// @param pairs when not null, receives n_k
/// A constant or empty sequence gives NaN.
Eigen::VectorXd autocorrelation(const Eigen::Ref<const Eigen::VectorXd>& e, int lags,
                                Eigen::VectorXd* pairs = nullptr);

/// Ljung & Box (1978): n (n+2) sum_k r_k^2 / (n-k) with the biased r_k; with missing samples each
/// lag is weighted by its own number of pairs. Degrees of freedom: lags. NaN for a constant or
/// empty sequence.
ChiSquareStatistic ljung_box(const Eigen::Ref<const Eigen::VectorXd>& e, int lags);

/// The number of lags used when nobody asks for another: min(20, n/5), at least 1.
int default_lags(Eigen::Index samples);

/// Normalised innovation squared, summed: sum_t e_t' Sigma_t^-1 e_t over standardised innovations,
/// chi-square with as many degrees of freedom as there are samples present (Bar-Shalom, Li &
/// Kirubarajan 2001, section 5.4).
/// @param standardised  ny x N, Sigma_t^(-1/2) e_t, NaN = missing
ChiSquareStatistic normalised_innovation_squared(
    const Eigen::Ref<const Eigen::MatrixXd>& standardised);

}  // namespace identikal
