// How does a program hand over samples that it has in memory?
#pragma once

#include <span>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "identify/model/model.h"
#include "lib/data/dataset.h"

namespace identikal {

/// Samples of one or several channels, channels x N; NaN where one is missing. A vector, a row or a
/// span is one channel; of a matrix every row is one.
struct Samples {
  Samples() = default;
  Samples(std::span<const double> channel);
  Samples(const std::vector<double>& channel) : Samples(std::span<const double>(channel)) {}
  template <typename Derived>
  Samples(const Eigen::MatrixBase<Derived>& given) {
    if constexpr (Derived::ColsAtCompileTime == 1) {
      values = given.transpose();
    } else {
      values = given;
    }
  }

  Eigen::MatrixXd values;
};

/// When the samples were taken [s]: a step apart from 0 on, or at these times.
struct SampleTimes {
  SampleTimes(double between) : step(between) {}
  template <typename Derived>
  SampleTimes(const Eigen::MatrixBase<Derived>& at) : times(at) {}
  SampleTimes(const std::vector<double>& at)
      : times(Eigen::Map<const Eigen::VectorXd>(at.data(), static_cast<Eigen::Index>(at.size()))) {}

  double step = 0.0;      ///< 0: the median of the steps
  Eigen::VectorXd times;  ///< N, rising; empty: k step
};

/// A recording for this model, its channels in the model's order, all in SI. What stands for a
/// pseudo-measurement is taken from the model, and outputs are missing where their condition does
/// not hold (output_conditions.h).
///
/// Example:
///
///     const Dataset log = recording(model, y, 0.1);
///
/// @param y  outputs x N
/// @param u  inputs x N; none for a model without inputs
/// @throws std::invalid_argument when a number of channels or of samples is another than the
///   model's or the outputs' (both are named), or as check_recording() (identify/model/check.h)
Dataset recording(const Model& model, const Samples& y, const SampleTimes& time,
                  const Samples& u = {});

/// The same with channels by name, in any order; those that the model does not have are left out,
/// pseudo-measurements need not be given, and flags are channels too.
///
/// Example:
///
///     const Dataset drive = recording(car, {{"r", y.row(0)}, {"vy", y.row(1)},
///         {"steering_wheel_angle", u.row(0)}, {"vx", u.row(1)}}, 0.01);
///
/// @throws std::invalid_argument as above, and for a channel of the model that is missing
Dataset recording(const Model& model, const std::vector<std::pair<std::string, Samples>>& channels,
                  const SampleTimes& time);

}  // namespace identikal
