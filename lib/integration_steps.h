// How many Runge-Kutta steps does a model need from sample to sample?
#pragma once

#include <vector>

#include <Eigen/Core>

#include "lib/nonlinear_model.h"

namespace identikal {

/// Twice as many steps change no state by more than
///   relative * max(|x_i|, floor * the largest |x_i| of the trajectory)
/// over the interval.
struct StepTolerance {
  double relative = 1e-8;
  double floor = 1e-3;
  int most = 1024;  ///< steps between two samples
};

/// How the choice ended.
enum class StepStatus {
  ok,
  capped,      ///< somewhere as many steps as are allowed do not reach the tolerance
  not_finite,  ///< the state leaves what numbers can hold, or a function its domain
};

/// A sentence for people.
const char* describe(StepStatus status);

struct IntegrationSteps {
  StepStatus status = StepStatus::ok;
  Eigen::Index sample = -1;  ///< not ok: the interval that begins there is the first such, 0-based
  std::vector<int> steps;    ///< N - 1, for input_nodes(); powers of two; not_finite: empty
  double largest_change = 0.0;  ///< by twice as many steps, against the tolerance's max(..)
};

/// Follows the trajectory without noise and doubles the steps of every interval until that changes
/// nothing. A grid is chosen once, for a start of a search, and kept: a likelihood on a grid that
/// changes with the parameters is not smooth. In discrete time one step each.
/// @param p     parameters, SI
/// @param x0    nx: state at the first sample
/// @param time  N strictly increasing time stamps [s]
/// @param u     nu x N, no NaN
/// @throws std::invalid_argument when shapes disagree, time does not increase, relative or floor
///   <= 0, or most is not 1 to a million
IntegrationSteps integration_steps(const NonlinearModel& model,
                                   const Eigen::Ref<const Eigen::VectorXd>& p,
                                   const Eigen::Ref<const Eigen::VectorXd>& x0,
                                   const Eigen::VectorXd& time, const Eigen::MatrixXd& u,
                                   InputPath path, const StepTolerance& tolerance = {});

}  // namespace identikal
