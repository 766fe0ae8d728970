// Which one-step predictor do recordings ask for? Regularised least squares over many lags, with how
// smooth and how short the responses are learnt from the recordings themselves.
#pragma once

#include <Eigen/Core>

#include "lib/subspace/lagged_products.h"

namespace identikal {

/// y_hat(t) = D u(t) + sum over k of H_k z(t-k), z = [y; u].
struct Predictor {
  Eigen::MatrixXd H;      ///< p x L(p+m): the blocks H_1 ... H_L
  Eigen::MatrixXd D;      ///< p x m
  Eigen::MatrixXd sigma;  ///< p x p: covariance of what it leaves
  Eigen::Index outputs() const { return D.rows(); }
  Eigen::Index inputs() const { return D.cols(); }
  Eigen::Index lags() const { return H.cols() / (D.rows() + D.cols()); }
};

/// Before the data every response h of the predictor, to an output or to an input, is Gaussian with
/// cov(h_k, h_l) = size * decay^max(k, l), relative to the variance of what the output leaves: the kernel TC
/// ("tuned and correlated") of Chen, Ohlsson and Ljung (2012), stable and smooth.
struct PredictorPrior {
  double output_size = 1.0, output_decay = 0.7;
  double input_size = 1.0, input_decay = 0.7;
};

/// The regressions of one set of sums, for any prior: empirical Bayes of Pillonetto and De Nicolao (2010).
///
/// Example:
///
///     const PredictorRegression regression(sums);
///     const PredictorPrior prior{.output_size = 10.0, .input_size = 10.0};
///     std::printf("log evidence %g\n", regression.log_evidence(prior));
///     const Predictor smooth = regression.estimate(prior);
class PredictorRegression {
 public:
  explicit PredictorRegression(const LaggedProducts& sums);
  /// Logarithm of the marginal likelihood, every output's noise variance at its maximum, less what no prior
  /// changes. One Cholesky factor of the size of the regression.
  double log_evidence(const PredictorPrior& prior) const;
  /// Posterior mean.
  Predictor estimate(const PredictorPrior& prior) const;

 private:
  struct Posterior;
  Eigen::VectorXd weights(const PredictorPrior& prior) const;
  Posterior posterior(const PredictorPrior& prior) const;
  template <typename Place>
  void for_each_coefficient(const Place& place) const;

  Eigen::Index p_, m_, lags_, windows_;
  Eigen::MatrixXd S_;   // products of sums of the regressors over rising numbers of lags
  Eigen::MatrixXd F_;   // of these with the outputs
  Eigen::MatrixXd YY_;  // of the outputs
};

}  // namespace identikal
