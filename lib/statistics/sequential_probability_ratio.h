// Is this sequence white, asked again with every new sample? Wald's sequential test against
// autoregressive models.
#pragma once

#include <vector>

#include <Eigen/Core>

namespace identikal {

struct SequentialProbabilityRatioOptions {
  std::vector<Eigen::Index> orders{1, 2, 5};  ///< of the autoregressive models tried, all at once
  double false_alarm = 0.05;                  ///< a: at most so often is white called coloured
  double miss = 0.01;                         ///< b: at most so often is coloured called white
  /// The smallest colour of interest: the square root of the share of the variance that the past
  /// predicts, summed over the channels. 0.3: 9 % of one channel's variance is predictable.
  double smallest = 0.3;
  double forgetting = 1.0;  ///< weight of the models' memory per sample, 0 < forgetting <= 1
};

/// What the samples so far say.
enum class SequentialDecision { undecided, white, coloured };

/// Least squares of a scalar on regressors, sample by sample, under a normal prior: precision
/// 1 / prior on each coefficient.
struct RecursiveRegression {
  Eigen::MatrixXd P;         ///< d x d, lower triangle: covariance of theta / variance of the noise
  Eigen::VectorXd theta;     ///< d
  Eigen::VectorXd gain;      ///< d, of the last sample
  double squares = 0.0;      ///< sum of squared residuals, each error over 1 + zeta
  double start_trace = 0.0;  ///< of P: forgetting never makes it less certain than that
};

/// The test's state. Read decision, samples and the two logarithms; the rest is workspace.
struct SequentialProbabilityRatio {
  SequentialProbabilityRatioOptions options;
  Eigen::Index outputs = 0;

  SequentialDecision decision = SequentialDecision::undecided;  ///< of the present run
  Eigen::Index samples = 0;   ///< complete samples of the present run
  double log_coloured = 0.0;  ///< coloured once it reaches log 1/a
  double log_white = 0.0;     ///< white once it reaches log 1/b

  bool scaled = false;        ///< the first samples have told the scale
  Eigen::Index unbroken = 0;  ///< complete samples since the last missing one
  Eigen::Index white_samples = 0;
  Eigen::MatrixXd products;   ///< ny x ny, lower triangle: sum e e' of the first samples
  Eigen::MatrixXd scale;      ///< ny x ny, lower triangle: their covariance's Cholesky factor
  Eigen::VectorXd window;     ///< ny (order + 1): the last samples, the newest at the end
  Eigen::VectorXd log_ratio;  ///< per order
  std::vector<RecursiveRegression> null;                ///< per channel
  std::vector<std::vector<RecursiveRegression>> model;  ///< per order, per channel
  std::vector<RecursiveRegression> white_null;          ///< per channel, for log_white
  std::vector<RecursiveRegression> white_full;
};

/// @param outputs  ny >= 1
/// @throws std::invalid_argument for options out of range
SequentialProbabilityRatio start_sequential_probability_ratio(
    Eigen::Index outputs, const SequentialProbabilityRatioOptions& options);

/// Forgets all samples, for a filter that has been tuned again. Allocates nothing.
void restart(SequentialProbabilityRatio& test);

/// Takes the next innovation and says what is known by now; after a decision the next sample begins
/// a new run. Nothing is allocated.
///
/// Coloured. With q_m the prediction by an autoregressive model of order m from all samples so far
/// and q_0 that by a white sequence of unknown covariance,
///
///   W(t) = mean over m of  prod_s q_m(e(s) | past) / q_0(e(s) | past),     coloured if W >= 1/a.
///
/// q_0 is the prediction under the right-invariant prior of the lower triangular factor of the
/// covariance: channel by channel Student's t of a regression on the channels before it. It is then
/// the true density of what remains of a white Gaussian sequence when its scale is divided out,
/// and q_m, recursive least squares on the channels before it and the last m samples, under a
/// prior that is relative to the scale of the first samples, is a density of the same. So W is a
/// nonnegative martingale of mean 1 when the sequence is white and Gaussian with a constant
/// covariance, whatever that is, and by Ville's inequality P(W ever >= 1/a) <= a: at any stopping
/// time, for any orders, any forgetting.
///
/// White. The alternative is stated: an autoregressive sequence of the highest order whose past
/// predicts at least smallest^2 of the variance. When even the most likely one of these is 1/b
/// times less likely than white noise, the sequence is called white,
///
///   (n / 2) log(1 + d^2 - 2 d R) >= log 1/b,   d = smallest (R where that is larger),
///
/// R^2 the share of the variance that least squares explain: a likelihood ratio against each of
/// these sequences, so P(white) <= b for each. What the bound leaves out is that the share is
/// measured with the recording's own second moments; tests measure the rate. White needs
/// about 2 log(1/b) / d^2 + 4 coefficients / d^2 samples. Forgetting does not enter here.
///
/// A sample with a missing (not finite) channel is left out, and a model of order m predicts again
/// when m samples are complete. The first 5 (ny + 1) samples of a run, and more while their
/// covariance is singular, only tell the scale: a sequence of zeros is never decided about.
///
/// Example:
///
///     auto test = start_sequential_probability_ratio(e.rows(), {});
///     for (Eigen::Index t = 0; t < e.cols(); ++t) {
///       if (update(test, e.col(t)) == SequentialDecision::coloured) std::puts("tune again");
///     }
///
/// @param innovation  ny
/// Source: Matisko (2013), (3.26) to (3.31), with these differences. The inequalities print a and b
/// exchanged ((3.31) would be empty): with T = log p_0/p_m Wald has white for T >= log((1-a)/b),
/// coloured for T <= log(a/(1-b)). The plugged-in variance s^2(t-1) of the source is no density of
/// the sample until it is known well, and p_m adapts while p_0 does too, so that T has no drift
/// towards white that b could be kept by: here the alternative is stated. Ville (1939); Robbins
/// (1970), Ann. Math. Statist. 41; Perez-Ortiz et al. (2024), Ann. Statist. 52, for the group.
SequentialDecision update(SequentialProbabilityRatio& test,
                          const Eigen::Ref<const Eigen::VectorXd>& innovation);

}  // namespace identikal
