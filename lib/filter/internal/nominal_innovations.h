// What is left of a segment once a fixed gain has taken out what can be predicted? Internal to the
// filter: lib/filter/internal/segment.h says what it is for.
#pragma once

#include <Eigen/Core>

#include "lib/filter/internal/segment.h"
#include "lib/model/state_space.h"

namespace identikal {

/// The filter with this gain over samples begin .. begin + length - 1, from the start that leaves
/// the least sum of squared innovations.
/// @param gain  n x ny, A - gain C must be stable and forget within `memory` samples
NominalInnovations nominal_innovations(const StateSpace& model, const Eigen::MatrixXd& gain,
                                       Eigen::Index memory, const Eigen::MatrixXd& y,
                                       const Eigen::MatrixXd& u, Eigen::Index begin,
                                       Eigen::Index length);

/// Do A, B, C and D still stand?
bool serves(const NominalInnovations& nominal, const StateSpace& model);

}  // namespace identikal
