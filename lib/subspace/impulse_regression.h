// Which impulse responses do recordings ask for, without a model of finite order? Regularised least squares with kernels.
#pragma once

#include <Eigen/Core>

#include "lib/subspace/lagged_products.h"

namespace identikal {

/// What is known of a response before the data: cov(h_k, h_l) in units of the variance of what the output leaves
/// (Chen, Ohlsson & Ljung 2012; Pillonetto & De Nicolao 2010 for the spline).
enum class Kernel {
  tuned_correlated,     ///< TC: size decay^max(k, l)
  diagonal_correlated,  ///< DC: size decay^((k + l)/2) correlation^|k - l|
  stable_spline,  ///< SS: size (decay^(k + l + max)/2 - decay^(3 max)/6), max = max(k, l): smooth
};

struct KernelPrior {
  Kernel kernel = Kernel::tuned_correlated;
  double size = 1.0;         ///< above 0
  double decay = 0.7;        ///< above 0, below 1
  double correlation = 0.9;  ///< of neighbours, above 0, below 1; DC only
  /// Of a second part that fades over all rows, zero where there is none: slow_size exp(-2 (k + l)/rows)
  /// slow_correlation^|k - l|.
  double slow_size = 0.0;
  double slow_correlation = 0.9;  ///< above 0, below 1
};

/// Its covariance of h_0 ... h_(rows-1).
Eigen::MatrixXd kernel_matrix(const KernelPrior& prior, Eigen::Index rows);

/// y(t) = sum over k = 0 ... L and inputs j of h_kj u_j(t-k) + noise, white and of its own variance for every output; by
/// empirical Bayes on sums of products.
///
/// Example:
///
///     const ImpulseRegression regression(lagged_products({y}, {u}, 50));
///     const KernelPrior prior{.kernel = Kernel::stable_spline, .size = 10.0, .decay = 0.9};
///     std::printf("log evidence %g\n", regression.log_evidence(prior));
///     const ImpulseRegression::Responses h = regression.estimate(prior);
class ImpulseRegression {
 public:
  /// @throws std::invalid_argument for sums without inputs
  explicit ImpulseRegression(const LaggedProducts& sums);
  Eigen::Index rows() const { return lags_ + 1; }  ///< of a response
  /// Logarithm of the marginal likelihood, every output's noise variance at its maximum, less what no prior changes.
  double log_evidence(const KernelPrior& prior) const;
  /// Posterior means and standard deviations, (m(L+1)) x p: input after input with rising lags.
  struct Responses {
    Eigen::MatrixXd value, se;
  };
  Responses estimate(const KernelPrior& prior) const;

 private:
  struct Posterior;
  Posterior posterior(const KernelPrior& prior) const;

  Eigen::Index p_, m_, lags_, windows_;
  Eigen::MatrixXd S_, F_;  // products of the regressors, and of these with the outputs
  Eigen::VectorXd YY_;     // of each output
};

}  // namespace identikal
