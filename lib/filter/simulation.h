// What might a linear model's outputs look like?
#pragma once

#include <Eigen/Core>

#include "lib/base/random.h"
#include "lib/filter/filter_result.h"
#include "lib/model/linear_model.h"
#include "lib/model/state_space.h"

namespace identikal {

/// `samples` outputs of the model, ny x samples: x(1) from the initial state's distribution (zero
/// with a diffuse start), then w and v jointly from [Q S; S' R] at every sample.
///
/// Example:
///
///     Random random(1);
///     const Eigen::MatrixXd simulated =
///         simulate_outputs(model, InitialState::stationary, u, u.cols(), random);
///
/// @param u       nu x samples, or empty: none
/// @param states  receives x(1) ... x(samples) as columns, when not nullptr
/// @throws std::invalid_argument when u does not fit, [Q S; S' R] or P0 is not positive
///   semidefinite, or the start is stationary and A is not stable.
Eigen::MatrixXd simulate_outputs(const StateSpace& model, InitialState initial,
                                 const Eigen::MatrixXd& u, Eigen::Index samples, Random& random,
                                 Eigen::MatrixXd* states = nullptr);
/// The same for a time-varying model. A stationary start is that of the model at t = 0.
Eigen::MatrixXd simulate_outputs(const ModelAt& model, InitialState initial,
                                 const Eigen::MatrixXd& u, Eigen::Index samples, Random& random,
                                 Eigen::MatrixXd* states = nullptr);

}  // namespace identikal
