// The full filter recursion over gapless samples, value only, by code made for small sizes.
// Internal to the filter: recursion.cpp takes it where nothing else is asked for.
#pragma once

#include <Eigen/Core>

#include "lib/model/state_space.h"

namespace identikal {

/// State of the recursion before sample t, and what it has summed up.
struct DirectRun {
  Eigen::VectorXd x;
  Eigen::MatrixXd P;
  double value = 0.0;  ///< -1/2 sum [ log|Sigma| + e' Sigma^-1 e ]
  bool definite = true;
};

/// The filter, by reference, and the samples that it runs over.
struct DirectFilter {
  const StateSpace& model;
  const Eigen::MatrixXd& W;   ///< G Q G'
  const Eigen::MatrixXd& Sw;  ///< G S
  const Eigen::Ref<const Eigen::MatrixXd>&y, &u;
  Eigen::Index end;        ///< of the samples without gaps
  bool stop_when_settled;  ///< as soon as P has stopped changing, to 1e-14 of itself
};

/// It serves so many states and 3 outputs.
inline constexpr Eigen::Index kMostDirectStates = 6;

/// Samples t .. end - 1, none missing, in the Joseph form of lib/filter/kalman.h. Returns the first
/// sample not used: t itself for more than 6 states or 3 outputs.
Eigen::Index run_direct(const DirectFilter& filter, Eigen::Index t, DirectRun& run);

}  // namespace identikal
