// Which discrete-time model has the same samples as a continuous-time one?
#pragma once

#include <vector>

#include "lib/model/state_space.h"

namespace identikal {

/// What the process noise covariance of a continuous-time model means.
enum class ProcessNoise {
  per_sample,  ///< covariance of the w that enters at each sample; as in a discrete-time model
  density,     ///< E w(t) w(s)' = Q delta(t - s)
};

/// What the inputs do between samples.
enum class InputHold {
  constant,  ///< u(t) until the next sample: zero-order hold
  linear,    ///< straight from u(t) to u(t+1): first-order hold
};

/// dx/dt = A x + B u + G w sampled every `step` seconds, with inputs held constant:
///
///   Phi = e^(A h),  Gamma = int_0^h e^(A s) ds B,  Qd = int_0^h e^(A s) G Q G' e^(A' s) ds
///
/// With InputHold::linear the result has twice the inputs, [u(t); u(t+1)] (with_next_sample() makes
/// them), B = [Gamma - Gamma1, Gamma1], D = [D, 0] and
///
///   Gamma1 = 1/h int_0^h e^(A (h - s)) s ds B
///
/// so that x keeps its meaning. C, R, x0 and P0 stay. With density the result has G = I and Q = Qd;
/// with per_sample G and Q stay.
///
/// Example:
///
///     const StateSpace sampled = discretise(model, ProcessNoise::density, 0.01);  // every 10 ms
///
/// @throws std::invalid_argument when shapes disagree, step <= 0, or S is not zero with density.
/// Integrals and exponential are series over a short step, which is doubled: fast poles keep their
/// digits. Source: van Loan (1978), "Computing integrals involving the matrix exponential"; Moler & van
/// Loan (2003), "Nineteen dubious ways to compute the exponential of a matrix", methods 1 and 3.
StateSpace discretise(const StateSpace& continuous, ProcessNoise noise, double step,
                      InputHold hold = InputHold::constant);

/// d(discretise(model)) in the direction `by` (derivatives of the continuous-time matrices), exact:
/// the series' derivative term by term. Step in s.
StateSpace discretise_derivative(const StateSpace& continuous, const StateSpace& by,
                                 ProcessNoise noise, double step,
                                 InputHold hold = InputHold::constant);

/// Both at once, with the derivatives in several directions, which share what the model needs.
/// @param derivatives  one of each of `by`, written; memory that is there is used
void discretise(const StateSpace& continuous, const std::vector<StateSpace>& by, ProcessNoise noise,
                double step, InputHold hold, StateSpace& out, std::vector<StateSpace>& derivatives);

/// [u(t); u(t+1)], 2 nu x N, of u, nu x N. The last sample is its own next: no measurement comes
/// after it.
Eigen::MatrixXd with_next_sample(const Eigen::MatrixXd& u);

}  // namespace identikal
