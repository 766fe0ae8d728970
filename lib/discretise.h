// Which discrete-time model has the same samples as a continuous-time one?
#pragma once

#include "lib/state_space.h"

namespace identikal {

/// What the process noise covariance of a continuous-time model means.
enum class ProcessNoise {
  per_sample,  ///< covariance of the w that enters at each sample; as in a discrete-time model
  density,     ///< E w(t) w(s)' = Q delta(t - s)
};

/// dx/dt = A x + B u + G w with inputs held between samples (zoh), sampled every `step` seconds:
///
///   Phi = e^(A h),  Gamma = int_0^h e^(A s) ds B,  Qd = int_0^h e^(A s) G Q G' e^(A' s) ds
///
/// C, D, R, x0, P0 and dt stay. With density the result has G = I and Q = Qd; with per_sample G and
/// Q stay.
/// @throws std::invalid_argument when shapes disagree, step <= 0, or S is not zero with density.
/// Source: van Loan (1978), "Computing integrals involving the matrix exponential".
StateSpace discretise(const StateSpace& continuous, ProcessNoise noise, double step);

/// d(discretise(model)) in the direction `by` (derivatives of the continuous-time matrices), exact:
/// the derivative of a matrix exponential is a block of one twice the size.
StateSpace discretise_derivative(const StateSpace& continuous, const StateSpace& by,
                                 ProcessNoise noise, double step);

}  // namespace identikal
