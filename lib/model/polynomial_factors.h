// Which parameters are the coefficients of a polynomial whose roots decide whether a model is stable,
// or whether its moving average is invertible?
#pragma once

#include <vector>

#include "lib/model/linear_model.h"

namespace identikal {

/// 1 - sum_k sign_k theta_k z^(k lag), z being one step back, theta_k the parameters' values.
struct PolynomialFactor {
  std::vector<int> parameters;  ///< indices into the ParameterSet, of the powers 1, 2, ...
  Eigen::VectorXd sign;         ///< 1 or -1 each
  int lag = 1;                  ///< 1, or the season
  bool moving_average = false;  ///< of the numerator; else of det(I - z A)
  int group = 0;                ///< of states, connected by A, that it belongs to
};

/// Factors of det(I - z A), and of the numerator from a process noise to an output, that free
/// parameters make up: scalars without bounds and priors that occur nowhere else and are all of the
/// powers of a factor, like those of a companion form and of seasonal factors multiplied with it. A
/// group of states that is connected by A counts by itself; where other states see it, they see what
/// the output sees. Told from the values that the matrices
/// take, whatever their form. Of models in discrete time, and of states that start stationary; those whose
/// Q is not free there may not be told apart from their images in the unit circle, and have no
/// factors of the numerator.
///
/// Example:
///
///     const LinearModel level = constant_model(model, InitialState::stationary);
///     for (const PolynomialFactor& factor : polynomial_factors(level, {})) {
///       std::printf("%s %zu\n", factor.moving_average ? "MA" : "AR", factor.parameters.size());
///     }
std::vector<PolynomialFactor> polynomial_factors(const LinearModel& model,
                                                 const ParameterSet& parameters);

}  // namespace identikal
