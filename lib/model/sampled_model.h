// Which discrete-time model links one sample of a recording to the next, where matrices hold inputs
// or time, or where samples are not evenly spaced?
#pragma once

#include <memory>
#include <vector>

#include <Eigen/Core>

#include "lib/model/linear_model.h"

namespace identikal {

/// The model of every sample of one recording, with exact derivatives:
///
///   x(t+1) = A_t x(t) + B_t u(t) + G_t w(t),  y(t) = C_t x(t) + D_t u(t) + v(t),
///
/// formulas of inputs and time with their values at the sample. In continuous time they stay until
/// the next sample, and A_t, B_t and the covariance of w(t) are those of discretise() over the
/// interval between the two, computed once for equal intervals. Keeps a reference to the model; one
/// per thread.
///
/// Example:
///
///     const LinearModel linear = constant_model(model, InitialState::diffuse);
///     SampledModel sampled(linear, time, u);
///     sampled.set_parameters({}, false);
///     StateSpace at_first = model;
///     sampled.at(0, at_first, nullptr);
class SampledModel {
 public:
  /// @param time  N strictly increasing stamps [s]; the intervals between them count with
  ///   LinearModel::irregular, else every one is LinearModel::dt
  /// @param u     inputs of the model file, nu x N
  /// @throws std::invalid_argument when shapes disagree or an interval is not positive
  SampledModel(const LinearModel& model, const Eigen::VectorXd& time, const Eigen::MatrixXd& u);
  ~SampledModel();
  SampledModel(SampledModel&&) noexcept;

  void set_parameters(const ParameterSet& parameters, bool with_derivatives);

  /// Do A, B, G, Q or S differ between samples?
  bool motion_changes() const;

  /// The model of sample t, 0-based, and, unless null, its derivatives by the free entries, in the
  /// order of free_entries().
  /// @throws std::invalid_argument when derivatives were not asked for in set_parameters()
  void at(Eigen::Index t, StateSpace& out, std::vector<StateSpace>* derivatives);

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace identikal
