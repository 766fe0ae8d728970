// What do those share that go through fixed Runge-Kutta steps from sample to sample? Internal to lib.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include <Eigen/Core>

namespace identikal {

/// The classical method's stages: how far into the step, their weights, the way from the step's begin
/// to the next one, and the node of the inputs.
struct RungeKuttaStage {
  double reach, weight, to_next;
  Eigen::Index node;
};
inline constexpr RungeKuttaStage kRungeKuttaStages[] = {{0.0, 1.0 / 6.0, 0.5, 0},
                                                        {0.5, 1.0 / 3.0, 0.5, 1},
                                                        {0.5, 1.0 / 3.0, 1.0, 1},
                                                        {1.0, 1.0 / 6.0, 0.0, 2}};

/// Steps of a model that is linear in its state are kept, for so many lengths of an interval: stamps
/// that are irregular have one each, and what would be kept is not met again.
inline constexpr std::size_t kMostRepeated = 256;

/// By how much equal intervals differ: both stamps are rounded, and so were those of the other one.
inline double interval_rounding(const Eigen::VectorXd& time) {
  return 4.0 * std::numeric_limits<double>::epsilon() *
         std::max(std::abs(time[0]), std::abs(time[time.size() - 1]));
}

}  // namespace identikal
