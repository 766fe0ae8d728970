// What takes one sample after the other behind ik_filter_step()?
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "identify/model/model.h"
#include "identify/noise/noise_tracker.h"
#include "identify/regression/online_regression.h"

namespace identikal {

/// A filter of any kind, in SI. What step() says stays until the next sample.
class SampleFilter {
 public:
  virtual ~SampleFilter() = default;

  /// @param y  outputs()  @param u  inputs(); may be null where there are none
  /// @return false where the sample cannot be taken
  virtual bool step(const double* y, const double* u) = 0;

  /// What the state is by now, its standard deviations, and what was not predicted of y.
  virtual const Eigen::VectorXd& state() const = 0;
  virtual const Eigen::VectorXd& sd() const = 0;
  virtual const Eigen::VectorXd& innovation() const = 0;

  Eigen::Index states = 0, inputs = 0, outputs = 0;
  /// Of what is learnt beside the state: names, values and their standard deviations.
  std::vector<std::string> parameters;
  virtual const Eigen::VectorXd& parameter_values() const { return none_; }
  virtual const Eigen::VectorXd& parameter_sd() const { return none_; }

 private:
  Eigen::VectorXd none_;
};

/// The Kalman filter of a linear model at its values. @throws InputError where its inputs are straight
/// between samples, which takes the next
std::unique_ptr<SampleFilter> kalman_sample_filter(const Model& model);
/// Recursive least squares: coefficients in the place of the state.
std::unique_ptr<SampleFilter> regression_sample_filter(const RegressionSettings& settings);
/// A filter whose noise is learnt. @throws InputError as kalman_sample_filter() and NoiseTracker
std::unique_ptr<SampleFilter> noise_sample_filter(const Model& model,
                                                  const NoiseTrackOptions& options);

}  // namespace identikal
