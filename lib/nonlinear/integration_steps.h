// How many Runge-Kutta steps does a model need from sample to sample?
#pragma once

#include <vector>

#include <Eigen/Core>

#include "lib/model/nonlinear_model.h"
#include "lib/nonlinear/filter.h"

namespace identikal {

/// Twice as many steps change no state by more than
///   relative * max(|x_i|, floor * the largest |x_i| of the trajectory)
/// over the interval.
struct StepTolerance {
  double relative = 1e-8;
  double floor = 1e-3;  ///< of a trajectory; a filter's deviations take its place
  int most = 1024;      ///< steps between two samples
};

/// How the choice ended, from good to bad.
enum class StepStatus {
  ok,
  capped,      ///< somewhere as many steps as are allowed do not reach the tolerance, as at a jump
  not_finite,  ///< the state leaves what numbers can hold, or a function its domain
};

/// A sentence for people.
const char* describe(StepStatus status);

struct IntegrationSteps {
  StepStatus status = StepStatus::ok;  ///< of the worst interval
  Eigen::Index sample = -1;  ///< not ok: the interval that begins there is the first such, 0-based
  std::vector<int> steps;    ///< N - 1, for input_nodes(); powers of two; not_finite: empty
  double largest_change = 0.0;  ///< by twice as many steps, against the tolerance's max(..)
};

/// Follows the trajectory without noise and doubles the steps of every interval until that changes
/// nothing. At a jump of the rates, whose error falls too slowly, a few steps are taken. A search
/// keeps its grid from evaluation to evaluation: a likelihood on one that changes with the
/// parameters is not smooth. In discrete time one step each.
///
/// Example:
///
///     const auto grid = integration_steps(pendulum, p, noise.x0, time, u, InputPath::linear);
///     const InputNodes inputs = input_nodes(time, u, InputPath::linear, grid.steps);
///
/// @param p     parameters, SI
/// @param x0    nx: state at the first sample
/// @param time  N strictly increasing time stamps [s]
/// @param u     nu x N, no NaN
/// @throws std::invalid_argument when shapes disagree, time does not increase, relative or floor
///   <= 0, or most is not 1 to kMostSteps
IntegrationSteps integration_steps(const NonlinearModel& model,
                                   const Eigen::Ref<const Eigen::VectorXd>& p,
                                   const Eigen::Ref<const Eigen::VectorXd>& x0,
                                   const Eigen::VectorXd& time, const Eigen::MatrixXd& u,
                                   InputPath path, const StepTolerance& tolerance = {});

/// The same for a filter, which looks at the states around its own, by changes relative to the
/// largest |x_i| of the record or its deviation: from x_filt and its deviations
/// x_filt +- L_j, L L' = P_filt + P_pred of the next sample. The filter that tells them runs on the
/// steps found so far, until none has to be halved. A state at rest in the mean moves in them.
/// Where the interval is longer than usual, `most` grows with it.
/// @param y  ny x N, NaN = missing
/// @return steps in any case: where the filter ends early, at its `sample` of not_finite, they are
///   those of the part before
/// @throws std::invalid_argument as nonlinear_filter() and above
IntegrationSteps integration_steps(const NonlinearModel& model,
                                   const Eigen::Ref<const Eigen::VectorXd>& p,
                                   const FilterNoise& noise, const Eigen::VectorXd& time,
                                   const Eigen::MatrixXd& u, InputPath path,
                                   const Eigen::Ref<const Eigen::MatrixXd>& y,
                                   const NonlinearFilterOptions& options = {},
                                   const StepTolerance& tolerance = {});

}  // namespace identikal
