// Where does a state come to rest while its inputs stay?
#pragma once

#include <Eigen/Core>

#include "lib/model/nonlinear_model.h"

namespace identikal {

/// The state at rest, and its exact derivatives: by the state that it was sought from, which is zero
/// but for what the motion conserves, and by p (columns as in Jacobian).
struct Equilibrium {
  bool found = false;
  Eigen::VectorXd x;      ///< nx
  Eigen::MatrixXd wrt_x;  ///< nx x nx
  Eigen::MatrixXd wrt_p;  ///< nx x model.columns
};

/// The limit of x' = f(x, u, p, 0) from x, followed with controlled steps over intervals that become
/// ever longer, until neither the state nor its derivatives move. Unlike a root of f it is the one
/// that the motion reaches, and what a reaction conserves stays as it was.
///
/// Example:
///
///     ModelMemory memory = make_memory(pendulum);
///     set_parameters(pendulum, memory, p);
///     const Equilibrium rest = equilibrium(pendulum, memory, Eigen::Vector2d(0.1, 0.0), u.col(0));
///     if (!rest.found) std::printf("it does not come to rest\n");
///
/// @param model   in continuous time; doses do not count
/// @param memory  with the parameters that were last set
/// @param x       nx: where the motion begins, SI
/// @param u       nu: inputs, which stay, SI
/// @return not found where the motion diverges, oscillates or has not settled after 36
///   intervals, each of them eight times as long as the one before
/// @throws std::invalid_argument in discrete time and when sizes disagree
Equilibrium equilibrium(const NonlinearModel& model, ModelMemory& memory,
                        const Eigen::Ref<const Eigen::VectorXd>& x,
                        const Eigen::Ref<const Eigen::VectorXd>& u);

}  // namespace identikal
