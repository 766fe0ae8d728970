// How do the errors of a simulation follow its unknowns, sample by sample?
#pragma once

#include <vector>

#include <Eigen/Core>

#include "identify/model/model.h"
#include "lib/data/dataset.h"

namespace identikal {

struct SimulationSlopes {
  std::vector<Eigen::Index> unknowns;  ///< coordinates of the parameters that move the outputs
  Eigen::MatrixXd errors;              ///< ny x N, SI: y - h of all recordings, NaN = missing
  std::vector<Eigen::MatrixXd>
      slopes;  ///< per output, N x unknowns: d error / d unknown; 0 where missing
};

/// By the linearised equations along the simulation, integrated to 1e-9 of a state's range.
///
/// Example:
///
///     const auto [unknowns, errors, slopes] = simulation_slopes(model, recordings, model.parameters);
///     const Eigen::MatrixXd information = slopes[0].transpose() * slopes[0];
///
/// @param model  one that allows_multiple_shooting() (shooting.h)
/// @return without errors where the simulation does not stay finite
SimulationSlopes simulation_slopes(const Model& model, const std::vector<Dataset>& recordings,
                                   const ParameterSet& at);

}  // namespace identikal
