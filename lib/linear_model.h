// Which state-space model does a set of parameters stand for? x(t+1) = A x + B u + G w, y = C x + D
// u + v with entries that are numbers or multiples of named parameters.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "lib/discretise.h"
#include "lib/parameter.h"
#include "lib/state_space.h"

namespace identikal {

/// constant + sum over entries of factor * parameter at (row, col), or one whole matrix-valued
/// parameter.
struct ParametrisedMatrix {
  struct Entry {
    int row, col;
    int parameter;  ///< index into the ParameterSet; a scalar
    double factor;
  };
  Eigen::MatrixXd constant;
  std::vector<Entry> entries;
  int block = -1;  ///< index of the matrix-valued parameter that is this matrix; -1 = none
};

/// How the state before the first measurement is distributed.
enum class InitialState {
  given,       ///< N(x0, P0)
  stationary,  ///< mean 0, covariance the solution of P = A P A' + G Q G'; needs a stable A
  diffuse,     ///< no knowledge of any state: exact diffuse (Durbin & Koopman 2012, chapter 5)
};

struct LinearModel {
  ParametrisedMatrix A, B, C, D, G, Q, R, S, x0, P0;
  InitialState initial = InitialState::stationary;
  double dt = 1.0;          ///< sampling period [s]
  bool continuous = false;  ///< A, B and G are those of dx/dt; sampled every dt
  ProcessNoise noise = ProcessNoise::per_sample;  ///< what Q is, in continuous time
  InputHold hold = InputHold::constant;           ///< in continuous time
};

/// All matrices of a discrete-time model as numbers, nothing free.
LinearModel constant_model(const StateSpace& system, InitialState initial);

/// The matrices as the model has them, at these parameter values: dx/dt = ... in continuous time.
/// x0 and P0 are filled for InitialState::given only.
StateSpace written_matrices(const LinearModel& model, const ParameterSet& parameters);

/// The discrete-time model at these parameter values. Its inputs are [u(t); u(t+1)] where they are
/// held linearly (lib/discretise.h).
StateSpace instantiate(const LinearModel& model, const ParameterSet& parameters);
/// The same into `out`, whose memory is used again.
void instantiate(const LinearModel& model, const ParameterSet& parameters, StateSpace& out);

/// The inputs that instantiate()'s model takes, of the model file's, nu x N.
Eigen::MatrixXd model_inputs(const LinearModel& model, const Eigen::MatrixXd& u);

/// d(instantiate) / d(entry), one per free entry (lib/parameter.h). In discrete time whatever the
/// values, as the matrices are linear in the entries. Shapes as instantiate() gives them.
std::vector<StateSpace> model_derivatives(const LinearModel& model, const ParameterSet& parameters);

}  // namespace identikal
