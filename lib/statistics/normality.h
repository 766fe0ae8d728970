// Are these samples Gaussian, and does their size stay the same?
#pragma once

#include <Eigen/Core>

#include "lib/statistics/whiteness.h"

namespace identikal {

/// Sample skewness m_3 / m_2^(3/2) and kurtosis m_4 / m_2^2, over the samples present.
struct Moments {
  double samples = 0.0, mean = 0.0, variance = 0.0;  ///< variance with divisor n
  double skewness = 0.0, kurtosis = 0.0;             ///< NaN for a constant or empty sequence
};
Moments moments(const Eigen::Ref<const Eigen::VectorXd>& e);

/// Skewness and kurtosis each brought to a standard normal first, two degrees of freedom; right
/// from about ten samples on. NaN for fewer than 8.
///
/// Example:
///
///     const ChiSquareStatistic normal = doornik_hansen(moments(e.row(0)));
///     if (normal.value > 9.21) std::puts("not Gaussian at 1 %");  // 2 degrees of freedom
///
/// Source: Doornik & Hansen (2008), Oxford Bulletin of Economics and Statistics 70.
ChiSquareStatistic doornik_hansen(const Moments& m);

/// Does the size of the samples depend on that of the ones before? Ljung and Box' statistic of the
/// squares of e (N, NaN = missing). Source: McLeod & Li (1983), J. Time Series Analysis 4.
ChiSquareStatistic mcleod_li(const Eigen::Ref<const Eigen::VectorXd>& e, int lags);

/// Hotelling's test of a mean of zero: n (n - ny) / ((n - 1) ny) mean' C^-1 mean, C the covariance
/// about the mean, over the samples that have all channels. NaN for n <= ny or a singular C.
/// @param e  ny x N, NaN = missing
FStatistic mean_test(const Eigen::Ref<const Eigen::MatrixXd>& e);

}  // namespace identikal
