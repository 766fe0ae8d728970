// Which B, D and first states make a simulation follow recordings best, given the poles?
#pragma once

#include <vector>

#include <Eigen/Core>

#include "lib/subspace/innovation_form.h"

namespace identikal {

/// The model with those B and D that minimise the sum of squares of y less its simulation, each recording
/// from a first state of its own: linear least squares, for given A and C. K and sigma stay. Outputs count by
/// the square of their unit: scale them. Missing outputs do not count.
///
/// Example:
///
///     const InnovationForm simulator = with_inputs_by_simulation(states.model(4), {y}, {u});
///
/// @param y  of every recording p x N, NaN = missing
/// @param u  of every recording m x N, nothing missing
/// @throws std::invalid_argument for a model without inputs, or recordings of other shapes
InnovationForm with_inputs_by_simulation(InnovationForm model,
                                         const std::vector<Eigen::MatrixXd>& y,
                                         const std::vector<Eigen::MatrixXd>& u);

}  // namespace identikal
