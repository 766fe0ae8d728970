// How does the filter run on once its gain has settled? State and innovations alone are carried
// from sample to sample, with their derivatives; what the likelihood needs of them is summed up.
// Internal to the filter.
#pragma once

#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "lib/filter/filter_result.h"
#include "lib/filter/internal/segment.h"
#include "lib/filter/internal/sensitivity.h"
#include "lib/model/state_space.h"

namespace identikal {

/// A filter whose gain, innovation covariance and their derivatives have settled.
struct SettledFilter {
  const StateSpace& model;
  const Eigen::MatrixXd& F;  ///< A - K C
  const Eigen::MatrixXd& K;
  const Eigen::LLT<Eigen::MatrixXd>& Sigma;
  const std::vector<Sensitivity>& by;
};

/// log|Sigma|
double log_determinant(const Eigen::LLT<Eigen::MatrixXd>& Sigma);

/// Runs from some sample on for as long as none is missing.
class SteadyRun {
 public:
  /// @param filter  kept by reference, as are y and u
  /// @param x       n: the state predicted for the first sample; its derivatives are the filter's
  SteadyRun(const SettledFilter& filter, const Eigen::Ref<const Eigen::MatrixXd>& y,
            const Eigen::Ref<const Eigen::MatrixXd>& u, Eigen::VectorXd x);

  /// Samples t, t + 1, ... Returns the first one that is not processed.
  /// @param store           receives innovations, or null
  /// @param e_sd            ny: their standard deviations
  Eigen::Index run(Eigen::Index t, FilterResult* store, const Eigen::VectorXd& e_sd);
  /// What all samples add to the likelihood, without its constant, to gradient and information.
  void add_to(Likelihood& out) const;

  const Eigen::VectorXd& x() const { return x_; }
  /// n x k: column i is dx/d(theta_i)
  const Eigen::MatrixXd& x_theta() const { return dX_; }

 private:
  void stack_derivatives();
  void advance_derivatives(Eigen::Index t);

  const SettledFilter& filter_;
  const Eigen::Ref<const Eigen::MatrixXd>&y_, &u_;
  double count_ = 0.0, squares_ = 0.0;  // samples; sum e' Sigma^-1 e
  Eigen::VectorXd x_, next_, e_, z_;    // z = L^-1 e, Sigma = L L'
  // Derivatives, those of the n states or ny outputs by one parameter below those by the one before.
  Eigen::MatrixXd K_theta_, A_theta_, B_theta_, C_theta_, D_theta_;
  bool dynamics_ = false,
       inputs_ = false;  // whether A_theta and C_theta, B_theta and D_theta count
  Eigen::MatrixXd dX_, dX_next_, dE_;
  Eigen::VectorXd Sie_, moved_, seen_, slope_;
  Eigen::MatrixXd power_, spread_;  // sum Sigma^-1 e e' Sigma^-1, sum dE' Sigma^-1 dE
};

/// From sample t of a segment on, value only and without inputs, in chunks side by side. Returns
/// the first sample that is not processed: t itself where it does not pay or the filter forgets too
/// slowly.
/// @param x      in: state predicted for sample t; out: for the sample returned
/// @param value  receives -1/2 sum [ log|Sigma| + e' Sigma^-1 e ]
Eigen::Index run_in_lanes(const SettledFilter& filter, const Eigen::Ref<const Eigen::MatrixXd>& y,
                          Segment& segment, Eigen::Index t, Eigen::VectorXd& x, double& value);

}  // namespace identikal
