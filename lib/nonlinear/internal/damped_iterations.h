// The iterated filter's way through the points that h is linearised at. Internal to lib:
// extended_filter.h goes along it.
#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "lib/nonlinear/internal/extended_kernel.h"

namespace identikal {

/// Looks for the least of 1/2 |y - h(xi)|^2 / R + 1/2 |xi - x|^2 / P, and stays where
/// xi = x + P way, so that no inverse of P is needed; without one of R it is not damped.
class DampedIterations {
 public:
  /// Room for xi of that many numbers in lanes.
  DampedIterations(const simd::ExtendedModel& model, std::size_t numbers);

  /// At xi = x.
  /// @param R        of all outputs, in lanes
  /// @param R_moves  since the last sample, or the outputs that are there do
  void begin(const double* R, bool R_moves, simd::ExtendedRun& run);

  /// Does xi, with the residuals e of all outputs, fall short of a quarter of what its linearisation
  /// promised? Then it is put half way back to the last point, or all the way when it is the `last`
  /// to be linearised at, and steps stay that short.
  bool steps_back(const Eigen::VectorXd& e, bool last, simd::ExtendedRun& run);

  /// From xi by a share of the way to the state that the innovations lead to.
  void advance(simd::ExtendedRun& run);

 private:
  double squares(int m);

  const simd::ExtendedModel& model_;
  std::vector<double> xi_, base_;  // in lanes
  Eigen::VectorXd way_, base_way_, residual_, whitened_;
  Eigen::MatrixXd present_R_, R_factor_;
  bool is_damped_ = false;
  double cost_ = 0.0, promised_ = 0.0, share_ = 1.0;  // of the last point; of a full step
};

}  // namespace identikal
