// Is this sequence white? Statistics with their degrees of freedom; p-values are the caller's
// business (identify/estimate/distribution.h).
#pragma once

#include <Eigen/Core>

#include "lib/statistics/autocovariance.h"

namespace identikal {

/// A statistic that is chi-square distributed with `dof` degrees of freedom when the hypothesis
/// holds.
struct ChiSquareStatistic {
  double value = 0.0;
  double dof = 0.0;
};

/// A statistic that is F distributed with `dof` and `dof_rest` degrees of freedom when the
/// hypothesis holds; NaN where there is nothing to test.
struct FStatistic {
  double value = 0.0;
  double dof = 0.0, dof_rest = 0.0;
};

/// The rows from one sample of a channel to its next, where other channels have the rows between:
/// the smallest lag, up to 100, at which at least a quarter of the samples present have a partner.
/// 1 where there is none, as for a complete sequence and for one with samples missing here and
/// there. e: N, NaN = missing.
Eigen::Index own_period(const Eigen::Ref<const Eigen::VectorXd>& e);

/// Autocorrelation of a scalar sequence about its mean at lags 1..lags, counted in own_period()s:
/// the samples of a sensor that comes on every second row follow each other. Missing samples (NaN) leave
/// out the pairs they are part of: r_k = (n / n_k) sum_t e_t e_(t+k) / sum_t e_t^2 over the n_k
/// pairs present, so that a complete sequence gives the usual (biased) estimate times n / (n - k).
/// @param e     N samples, NaN = missing
/// @param lags  at least 1
/// @param pairs when not null, receives n_k
/// @return lags numbers; NaN for a constant or empty sequence, and where there is no pair
Eigen::VectorXd autocorrelation(const Eigen::Ref<const Eigen::VectorXd>& e, int lags,
                                Eigen::VectorXd* pairs = nullptr);

/// Ljung & Box (1978): n (n+2) sum_k r_k^2 / (n-k) with the biased r_k; with missing samples each
/// lag is weighted by its own number of pairs. Degrees of freedom: lags. NaN for a constant or
/// empty sequence. e: N, NaN = missing.
///
/// Example:
///
///     const ChiSquareStatistic q = ljung_box(e.row(0), default_lags(e.cols()));
///     const ChiSquareStatistic all_channels = portmanteau(e, 5);
ChiSquareStatistic ljung_box(const Eigen::Ref<const Eigen::VectorXd>& e, int lags);

/// Mehra's (1970) count: of the M lags of channel i the share of which
///   |Gamma_k(i, i)| < quantile / sqrt(N),
/// quantile that of the normal distribution for the level, e.g. 1.96 for 95 %.
/// @param gamma  Gamma_k, k = 0 .. M, by Divisor::equal_variance (lib/statistics/autocorrelation.h)
/// @return ny, in [0, 1]. As published a channel is white when its share is above the level: of
/// 20 lags and 95 %, when none or one lies outside minus rounding, which white noise fails far more
/// often than it promises.
/// Source: Matisko (2013), section 3.3.1.
Eigen::VectorXd mehra_share(const Autocovariances& gamma, Eigen::Index samples, double quantile);

/// N Psi_j(M) = N sum_(k=1)^M Gamma_k(j, j)^2, ny, chi-square with M degrees of freedom per
/// channel. As published all channels are tested at the full level and what one says of another is
/// not looked at. @param gamma  as for mehra_share Source: Matisko (2013), (3.13), (3.14).
Eigen::VectorXd published_chi_square(const Autocovariances& gamma, Eigen::Index samples);

/// All channels and all pairs of them together, with exact means:
///
///   Q = sum_(k=1)^M w_k tr(C_k' C_0^-1 C_k C_0^-1),   degrees of freedom M ny^2,
///
/// C_k about zero, which is the mean that innovations have by hypothesis, w_k such that every lag
/// has expectation ny^2 when the sequence is white and Gaussian, whatever its covariance:
///
///   w_k = N (N-1) (N+2) ny^2 / ((N-k) (ny^2 (N+1) - 2 ny)).
///
/// For one channel that is Ljung and Box' N (N+2) / (N-k); Hosking's (1980) N^2 / (N-k) and Li and
/// McLeod's (1981) N with M (M+1) ny^2 / (2 N) added are the same to first order. Why: with
/// whitened samples U, U U' = I, the trace is tr(J P J' P), J the shift by k and P = U' U the
/// projection on a uniformly distributed subspace, with E P_ab P_cd = a d_ab d_cd + b (d_ac d_bd +
/// d_ad d_bc), of which only a |J|^2 = a (N-k) is left.
///
/// With missing samples every entry of C_k is a mean over its own pairs, weighted by the root of
/// their number.
/// @param e  ny x N, NaN = missing
/// @return NaN for fewer than ny + 2 samples, and where C_0 is singular
ChiSquareStatistic portmanteau(const Eigen::Ref<const Eigen::MatrixXd>& e, int lags);

/// The number of lags used unless another is given: min(20, n/5), at least 1.
int default_lags(Eigen::Index samples);

/// Normalised innovation squared, summed: sum_t e_t' Sigma_t^-1 e_t over standardised innovations,
/// chi-square with as many degrees of freedom as there are samples present (Bar-Shalom, Li &
/// Kirubarajan 2001, section 5.4).
/// @param standardised  ny x N, Sigma_t^(-1/2) e_t, NaN = missing
ChiSquareStatistic normalised_innovation_squared(
    const Eigen::Ref<const Eigen::MatrixXd>& standardised);

}  // namespace identikal
