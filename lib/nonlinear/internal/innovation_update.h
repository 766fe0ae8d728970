// What does one sample's innovation say: about the state, and about the likelihood? Internal to
// lib: lib/nonlinear/filter.h is what others use.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "lib/filter/kalman.h"
#include "lib/internal/direction_stack.h"

namespace identikal {

/// The outputs before they are measured, and their derivatives.
struct OutputMoments {
  Eigen::VectorXd e;      ///< ny: innovation, y less its mean
  Eigen::MatrixXd M;      ///< nx x ny: cov(x, y)
  Eigen::MatrixXd Sigma;  ///< ny x ny: cov(y), positive definite
  Stack de, dM, dSigma;
};
/// For nx states, ny outputs and k directions.
OutputMoments make_output_moments(Eigen::Index nx, Eigen::Index ny, Eigen::Index k);

/// The update by one sample after the other, with the likelihood's sums. For each sample look_at()
/// comes first, then one of the set()s, then correct() where there is a state to correct, then
/// add_terms().
class InnovationUpdate {
 public:
  InnovationUpdate(Eigen::Index nx, Eigen::Index ny, Eigen::Index k);

  /// Which channels hold a number.
  /// @return how many
  Eigen::Index look_at(const Eigen::Ref<const Eigen::VectorXd>& y);
  bool is_present(Eigen::Index channel) const { return present_[channel] != 0; }
  /// Have other channels held numbers at a sample since this was asked before?
  bool take_change();

  /// Standardises the innovation. A channel that is missing then measures nothing, with noise one:
  /// it adds no term, and the gain is zero there.
  /// @return ok, not_finite or indefinite
  FilterStatus set(OutputMoments& moments);
  /// The same where no state is corrected and Sigma = R at every sample.
  FilterStatus set_constant(OutputMoments& moments, const Eigen::MatrixXd& R, const Stack& dR);

  /// next_x = x + K e and its derivatives, K = M Sigma^-1.
  void correct(const OutputMoments& moments, const Eigen::VectorXd& x, const Stack& dx,
               Eigen::VectorXd& next_x, Stack& next_dx);
  const Eigen::MatrixXd& gain() const { return K_; }            ///< after correct()
  const Eigen::VectorXd& weighted() const { return w_; }        ///< Sigma^-1 e, after correct()
  const Eigen::VectorXd& standardised() const { return eps_; }  ///< L^-1 e with L L' = Sigma

  /// Adds the sample's terms to value, gradient and information.
  /// @param score_products  null: none; the upper triangle of s s' is added
  void add_terms(const OutputMoments& moments, Eigen::MatrixXd* score_products);
  /// The sums so far, of an end with this status.
  Likelihood finish(FilterStatus status);

 private:
  void leave_out_missing(OutputMoments& moments) const;
  FilterStatus factorise(const OutputMoments& moments);
  void standardise(const Eigen::VectorXd& e);
  void set_gain(const Eigen::MatrixXd& M);
  void whiten(const Stack& dSigma);
  void add_noise_information(Eigen::MatrixXd& to) const;
  void release_constant_information();

  Eigen::Index nx_, ny_, k_;
  std::vector<int> present_;  // per channel; -1: not looked at yet
  Eigen::Index present_count_ = 0, samples_ = 0;
  bool changed_ = true;
  Eigen::MatrixXd factor_, K_;    // L with L L' = Sigma
  double log_determinant_ = 0.0;  // of Sigma
  Eigen::VectorXd eps_, w_;
  Stack q_, Z_, V_;  // V = L^-1 dSigma L^-1'
  Eigen::RowVectorXd score_;
  Likelihood out_;
  // With a constant Sigma its share of the information is the same at every sample with the same
  // channels: of how many samples it is still to be added.
  bool constant_ = false, constant_moves_ = false;
  Eigen::MatrixXd constant_information_;
  double constant_samples_ = 0.0;
};

}  // namespace identikal
