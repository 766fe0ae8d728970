// Which paths may the state have taken, given the whole recording?
#pragma once

#include <Eigen/Core>

#include "lib/base/random.h"
#include "lib/filter/kalman.h"
#include "lib/model/state_space.h"

namespace identikal {

struct SimulatedPath {
  FilterStatus status = FilterStatus::ok;
  Eigen::MatrixXd x;  ///< n x N: a draw from p(x(1), ..., x(N) | y)
};

/// One draw of the whole path, jointly over all samples: x+ and y+ of the model itself, and
///
///   x = x+ + E(x | y - y+)
///
/// has the mean and covariance of the state given y, from sample to sample too. A diffuse start takes
/// x+(1) as zero: what y - y+ says of it is all that is known.
///
/// Example:
///
///     Random random(1);
///     const SimulatedPath path = simulate_path(model, InitialState::diffuse, y, u, random);
///     if (path.status == FilterStatus::ok) std::printf("peak %g\n", path.x.row(0).maxCoeff());
///
/// @param model, initial, y, u  as smooth() (lib/filter/smoother.h)
/// @throws std::invalid_argument when shapes disagree or [Q S; S' R] or P0 is not positive
///   semidefinite
/// Source: Durbin & Koopman (2002), "A simple and efficient simulation smoother for state space time
/// series analysis".
SimulatedPath simulate_path(const StateSpace& model, InitialState initial,
                            const Eigen::Ref<const Eigen::MatrixXd>& y,
                            const Eigen::Ref<const Eigen::MatrixXd>& u, Random& random);
/// The same for a time-varying model.
SimulatedPath simulate_path(const ModelAt& model, InitialState initial,
                            const Eigen::Ref<const Eigen::MatrixXd>& y,
                            const Eigen::Ref<const Eigen::MatrixXd>& u, Random& random);

}  // namespace identikal
