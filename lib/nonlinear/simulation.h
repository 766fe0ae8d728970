// What would a recording of a model made of formulas look like? Data with known truth.
#pragma once

#include <Eigen/Core>

#include "lib/base/random.h"
#include "lib/nonlinear/filter.h"

namespace identikal {

struct NonlinearRealisation {
  Eigen::MatrixXd x;  ///< nx x N
  Eigen::MatrixXd y;  ///< ny x N, with noise
};

/// x(1) from N(x0, P0); then step() and w from sample to sample, with the covariance that the
/// filter of lib/nonlinear/filter.h gives w: a density needs samples so close to each other that
/// the noise between two of them leaves the motion straight. What overflows is not finite.
///
/// Example:
///
///     Random random(1);
///     const InputNodes inputs = input_nodes(time, u, InputPath::constant, 0.01);
///     const NonlinearRealisation truth = simulate_nonlinear_outputs(
///         pendulum, p, noise, ProcessNoise::density, inputs, random);
///
/// @param p       parameters, SI
/// @param inputs  N samples
/// @param scales  of the measurement noise's standard deviations, at the state that it is added to
///   (NonlinearFilterOptions); null: 1
/// @throws std::invalid_argument when shapes disagree or a covariance is not positive semidefinite
NonlinearRealisation simulate_nonlinear_outputs(const NonlinearModel& model,
                                                const Eigen::Ref<const Eigen::VectorXd>& p,
                                                const FilterNoise& noise, ProcessNoise kind,
                                                const InputNodes& inputs, Random& random,
                                                const NonlinearModel* scales = nullptr);

}  // namespace identikal
