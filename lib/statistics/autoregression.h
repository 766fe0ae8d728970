// Which autoregressive model would have these autocovariances, and of which order is it?
#pragma once

#include <vector>

#include <Eigen/Core>

#include "lib/statistics/autocovariance.h"

namespace identikal {

/// e(t) = sum_k A_k e(t-k) + w, w of covariance S, of every order 0 .. M.
struct Autoregressions {
  std::vector<Eigen::MatrixXd> S;               ///< per order; ends early where it is not definite
  std::vector<std::vector<Eigen::MatrixXd>> A;  ///< per order m, A_1 .. A_m
};

/// Solves the Yule-Walker equations of all orders in turn by Whittle's (1963) recursion, the
/// matrix form of Levinson's and Durbin's.
/// @param Y  Y_k = E e(t+k) e(t)', k = 0 .. M. Definite of every order when taken with
///   Divisor::samples (lib/statistics/autocorrelation.h) from a complete record
/// @return no order at all when Y_0 is not positive definite
/// Source: Matisko (2013), (3.18) to (3.20).
Autoregressions yule_walker(const Autocovariances& Y);

/// Share of each channel's variance that its own and the others' past explains,
///
///   1 - S(m)_ii / S(0)_ii,
///
/// less what m l^2 / (l N) of it chance explains of white noise; 0 where nothing is left.
///
/// Example:
///
///     const Autocovariances Y = sample_autocovariances(e, 6, Divisor::samples);
///     const Eigen::VectorXd share = share_explained_by_past(yule_walker(Y), e.cols());
///
/// @param samples  N
/// @return per channel, of the highest order; empty without an order
Eigen::VectorXd share_explained_by_past(const Autoregressions& models, Eigen::Index samples);

/// How many independent samples tell as much of a correlation as these do,
///
///   N / (1 + 2 sum_k rho_k^2)                                          (Bartlett 1946)
///
/// with rho_k, k = 1 .. N - 1, the autocorrelations of the autoregression that AIC chooses, of order 20
/// at most.
///
/// @param e  N, NaN = missing
/// @return 0 where e is zero or there are no pairs
double independent_samples(const Eigen::Ref<const Eigen::VectorXd>& e);

/// g(N) of (3.17), per order, in multiples of l^2.
enum class Penalty {
  aic,  ///< 2
  bic,  ///< log N
  hq,   ///< 2 log log N (Hannan & Quinn 1979)
  edc,  ///< sqrt(N): of the many that the efficient determination criterion allows (Zhao,
        ///< Krishnaiah & Bai 1986: o(N), and faster than log log N)
};

struct OrderChoice {
  Eigen::Index order = 0;     ///< m*, the minimiser; white when 0
  Eigen::VectorXd criterion;  ///< N log(|S(m)| / |S(0)|) + m l^2 g(N), m = 0 .. M: 0 at m = 0
  double least =
      0.0;  ///< its minimum over m >= 1; positive exactly when the order is 0. NaN, M = 0
};

/// @param samples  N >= 3
/// @throws std::invalid_argument when there is no order 0, or too few samples
/// Source: Matisko (2013), (3.17), (3.21), (3.22). As printed, (3.22) takes the minimum of 0 and
/// the criteria and accepts when that is above 0, which never happens; without the 0 it accepts
/// exactly when (3.21) does: the two criteria are one.
///
/// Example:
///
///     const Autocovariances Y = sample_autocovariances(e, 11, Divisor::samples);
///     const OrderChoice best = autoregressive_order(yule_walker(Y), e.cols(), Penalty::bic);
///     if (best.order == 0) std::puts("white");
OrderChoice autoregressive_order(const Autoregressions& models, Eigen::Index samples,
                                 Penalty penalty);

}  // namespace identikal
