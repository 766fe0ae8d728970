// The full filter recursion over gapless samples, value only, by code made for small sizes.
// Internal to lib: lib/filter/kalman.cpp takes it where nothing else is asked for.
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

/// Samples t .. end - 1, none missing, in the Joseph form of lib/filter/kalman.h. Where
/// stop_when_settled, ends as soon as P has stopped changing, to 1e-14 of itself. Returns the first
/// sample not used: t itself for more than 6 states or 3 outputs.
/// @param W, Sw  G Q G', G S
Eigen::Index run_direct(const StateSpace& model, const Eigen::MatrixXd& W,
                        const Eigen::MatrixXd& Sw, const Eigen::Ref<const Eigen::MatrixXd>& y,
                        const Eigen::Ref<const Eigen::MatrixXd>& u, Eigen::Index t,
                        Eigen::Index end, bool stop_when_settled, DirectRun& run);

}  // namespace identikal
