// What was the state of a model made of formulas, given the whole recording, or what was recorded
// up to some time later?
#pragma once

#include <optional>

#include <Eigen/Core>

#include "lib/filter/smoother.h"
#include "lib/nonlinear/filter.h"

namespace identikal {

/// Rauch-Tung-Striebel smoother, extended or unscented: smooth() of the linear model that
/// nonlinear_filter() has followed,
///
///   x(t+1) = Phi(t) x(t) + c(t) + w,  y(t) = H(t) x(t) + d(t) + v
///
/// with Phi and cov w = W along the trajectory from x_filt, and H at x_pred (extended) or x_filt
/// (iterated). Unscented: the lines that have the moments of the sigma points, cov(x(t), x(t+1)) =
/// P_filt Phi' and cov(x(t), y(t)) = P_pred H', what is left of the covariances added to W and R.
/// What it says of the last sample is the filter's. One pass: the lines are not drawn again around
/// the smoothed states.
///
/// Example:
///
///     const InputNodes inputs = input_nodes(time, u, InputPath::linear, 0.01);
///     const SmootherResult path = nonlinear_smoother(pendulum, p, noise, inputs, y);
///
/// @param lag  samples, >= 0: given what was recorded up to so many later; none: the whole record
/// @throws std::invalid_argument as nonlinear_filter(), and for a negative lag
/// Source: Särkkä (2013), sections 9.1 and 9.3 (the same recursion, with P_pred inverted).
SmootherResult nonlinear_smoother(const NonlinearModel& model,
                                  const Eigen::Ref<const Eigen::VectorXd>& p,
                                  const FilterNoise& noise, const InputNodes& inputs,
                                  const Eigen::Ref<const Eigen::MatrixXd>& y,
                                  const NonlinearFilterOptions& options = {},
                                  std::optional<Eigen::Index> lag = {},
                                  SmootherKeep keep = SmootherKeep::covariances);

}  // namespace identikal
