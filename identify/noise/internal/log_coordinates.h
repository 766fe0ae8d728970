// How does a search move numbers that may be decades off?
#pragma once

#include <vector>

#include <Eigen/Core>

#include "identify/model/model.h"
#include "solvers/scoring.h"

namespace identikal {

/// Some coordinates x_i > 0 as their logarithms z_i = log x_i, the others as they are.
struct LogCoordinates {
  std::vector<Eigen::Index> entries;

  Eigen::VectorXd from(Eigen::VectorXd x) const;
  Eigen::VectorXd to(Eigen::VectorXd z) const;
  /// The same likelihood by z; dL/dz_i = x_i dL/dx_i, and the information of z. Refers to both.
  LikelihoodProblem problem(const LikelihoodProblem& by_x) const;
};

/// Those that move by their logarithms (lib/model/parameter.h): where the model file says so, and of
/// equations that are not linear.
/// @param besides  coordinates that stay as they are
LogCoordinates logarithmic_coordinates(const Model& model,
                                       const std::vector<Eigen::Index>& besides);

}  // namespace identikal
