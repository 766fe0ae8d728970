// Which state-space model does a set of parameters stand for? x(t+1) = A x + B u + G w, y = C x + D
// u + v with entries that are numbers, multiples of named parameters or formulas of them.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "lib/formula/tape.h"
#include "lib/model/discretise.h"
#include "lib/model/parameter.h"
#include "lib/model/state_space.h"

namespace identikal {

/// constant + sum over entries of factor * parameter at (row, col) + formulas there, or one whole
/// matrix-valued parameter.
struct ParametrisedMatrix {
  struct Entry {
    int row, col;
    int parameter;  ///< index into the ParameterSet; a scalar
    double factor;
  };
  /// Value number `value` of LinearModel::formulas[tape]; of scalar parameters.
  struct Formula {
    int row, col;
    int tape, value;
    std::vector<int> parameters;  ///< that occur in it: indices into the ParameterSet
    bool moves = false;           ///< inputs or time occur in it: it has a value per sample
  };
  Eigen::MatrixXd constant;
  std::vector<Entry> entries;
  std::vector<Formula> formulas;
  int block = -1;  ///< index of the matrix-valued parameter that is this matrix; -1 = none
};

/// Numbers, nothing free.
ParametrisedMatrix constant_matrix(Eigen::MatrixXd value);

/// Formulas of the parameters, of inputs and of time, compiled together with their derivatives with
/// respect to all parameters that may occur in them: the first `tape.columns` of the ParameterSet,
/// scalars.
struct EntryFormulas {
  Tape tape;
  int first = 0;        ///< symbol that stands for parameter 0
  int first_input = 0;  ///< symbol that stands for input 0
  int inputs = 0;       ///< how many there are
  int time = -1;        ///< symbol that stands for the time; -1: none
};

/// What formulas see that changes from sample to sample.
struct MovingValues {
  Eigen::VectorXd inputs;  ///< SI; those that are not given are 1
  double time = 0.0;       ///< [s]
};

/// How the state before the first measurement is distributed.
enum class InitialState {
  given,       ///< N(x0, P0)
  stationary,  ///< mean 0, covariance the solution of P = A P A' + G Q G'; needs a stable A
  diffuse,     ///< no knowledge of any state: exact diffuse (Durbin & Koopman 2012, chapter 5)
  /// N(x0, P0), and no knowledge of the states whose variance in P0 is infinite
  partly_diffuse,
};

struct LinearModel {
  ParametrisedMatrix A, B, C, D, G, Q, R, S, x0, P0;
  InitialState initial = InitialState::stationary;
  /// With InitialState::partly_diffuse: states, 0-based, that start in their steady state; the others
  /// do not move them (lib/model/partly_diffuse.h).
  std::vector<Eigen::Index> stationary;
  /// With InitialState::partly_diffuse: states that start from N(mean, sd^2) each.
  struct StartOfState {
    Eigen::Index state;
    double mean = 0.0, sd = 0.0;
  };
  std::vector<StartOfState> known;
  double dt = 1.0;          ///< sampling period [s]
  bool continuous = false;  ///< A, B and G are those of dx/dt; sampled every dt
  ProcessNoise noise = ProcessNoise::per_sample;  ///< what Q is, in continuous time
  InputHold hold = InputHold::constant;           ///< in continuous time
  std::vector<EntryFormulas> formulas;            ///< that matrices refer to
  bool offset = false;     ///< the last column of B and D belongs to an input that is always 1
  bool irregular = false;  ///< sampled at a recording's own times instead of every dt
  /// What formulas of inputs and time take where one sample stands for all, as in a printed R.
  MovingValues typical;
};

/// Does it hold formulas of inputs or time?
bool moves(const ParametrisedMatrix& matrix);
bool holds_moving(const LinearModel& model);  ///< does any of its matrices?

/// Do its matrices change from sample to sample (lib/model/sampled_model.h)?
bool changes(const LinearModel& model);

/// The parameters that a matrix depends on, in rising order.
std::vector<int> parameters_in(const ParametrisedMatrix& matrix);

/// Does it hold no free parameter?
bool is_known(const ParametrisedMatrix& matrix, const ParameterSet& parameters);

/// Are the matrices linear in the free parameters, so that model_derivatives() are constant?
bool is_linear_in_parameters(const LinearModel& model, const ParameterSet& parameters);

/// The model with numbers in the place of formulas that hold no free parameter.
LinearModel with_known_formulas_as_numbers(LinearModel model, const ParameterSet& parameters);

/// All matrices of a discrete-time model as numbers, nothing free.
LinearModel constant_model(const StateSpace& system, InitialState initial);

/// The matrices as the model has them, at these parameter values: dx/dt = ... in continuous time.
/// x0 and P0 are filled for InitialState::given only, by instantiate() for a partly diffuse start too. Formulas of inputs and time take
/// LinearModel::typical, here and below.
StateSpace written_matrices(const LinearModel& model, const ParameterSet& parameters);

/// The discrete-time model at these parameter values. Its inputs are [u(t); u(t+1)] where they are
/// held linearly (lib/model/discretise.h).
///
/// Example:
///
///     LinearModel level = constant_model(model, InitialState::diffuse);
///     level.Q.constant.setZero();
///     level.Q.entries = {{.row = 0, .col = 0, .parameter = 0, .factor = 1.0}};
///     const Parameter q{.name = "q", .value = Eigen::MatrixXd::Constant(1, 1, 1469.0)};
///     const StateSpace at_start = instantiate(level, {q});
///
/// @throws std::invalid_argument for an entry outside of its matrix or of the parameters
StateSpace instantiate(const LinearModel& model, const ParameterSet& parameters);
/// The same into `out`, whose memory is used again.
void instantiate(const LinearModel& model, const ParameterSet& parameters, StateSpace& out);

/// The inputs that instantiate()'s model takes, of the model file's, nu x N: with an offset and
/// the next sample as the model needs them.
Eigen::MatrixXd model_inputs(const LinearModel& model, const Eigen::MatrixXd& u);

/// d(instantiate) / d(entry), one per free entry (lib/model/parameter.h), exact. Constant in
/// discrete time where is_linear_in_parameters(). Shapes as instantiate() gives them.
std::vector<StateSpace> model_derivatives(const LinearModel& model, const ParameterSet& parameters);

}  // namespace identikal
