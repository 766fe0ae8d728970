// How does a state move that formulas describe?
#pragma once

#include <vector>

#include <Eigen/Core>

#include "lib/expression.h"
#include "lib/tape.h"

namespace identikal {

/// What was written. The formulas' symbols are numbered: states, inputs, parameters, the time, then
/// the definitions, each of which may use those before it.
struct ModelFormulas {
  int states = 0, inputs = 0, parameters = 0;
  std::vector<Expression> definitions;
  std::vector<Expression> dynamics;  ///< per state: x' = f(x, u, p, t) or x(t+1) = f(x, u, p, t)
  std::vector<Expression> outputs;   ///< y = h(x, u, p, t)
  bool continuous = true;
};

/// The same, ready to be evaluated.
struct NonlinearModel {
  Eigen::Index states = 0, inputs = 0, parameters = 0, outputs = 0;
  bool continuous = true;
  Tape rates;          ///< f
  Tape rate_slopes;    ///< f and its derivatives by [x; p]
  Tape output_slopes;  ///< h and its derivatives by [x; p]
  /// x' or x(t+1) = A x + B u + c, y = C x + D u + d with matrices of the parameters alone.
  bool linear = false;
  bool offset = false;  ///< c or d is there
  Tape matrices;        ///< linear: A, [B c], C, [D d], row by row, and their derivatives by p
};

/// @throws std::invalid_argument unless there is a formula per state; FormulaError when the
/// derivatives are too large
NonlinearModel make_nonlinear_model(const ModelFormulas& formulas);

/// A linear model's matrices. With an offset, B and D have a last column for an input that is
/// always 1.
struct LinearFormMatrices {
  Eigen::MatrixXd A, B, C, D;
};
struct LinearForm {
  LinearFormMatrices value;
  std::vector<LinearFormMatrices> by_parameter;  ///< exact
};
/// @param p  parameters, SI
/// @throws std::invalid_argument unless the model is linear
LinearForm linear_form(const NonlinearModel& model, const Eigen::Ref<const Eigen::VectorXd>& p);

/// What inputs do between samples.
enum class InputPath {
  constant,  ///< u(t) until the next sample: zero-order hold
  linear,    ///< straight to the next sample: first-order hold
  pchip,     ///< a smooth curve that keeps the shape of the data (lib/interpolation.h)
};

/// The inputs where a Runge-Kutta method needs them: for every interval between two samples, at the
/// begin, middle and end of each of its steps.
struct InputNodes {
  Eigen::VectorXd time;             ///< N samples [s]
  std::vector<int> steps;           ///< N - 1
  std::vector<Eigen::Index> first;  ///< column of an interval's begin
  Eigen::MatrixXd u;                ///< nu x sum(2 steps + 1)
};

/// @param time          N strictly increasing time stamps [s], any spacing
/// @param u             nu x N, no NaN
/// @param longest_step  of the Runge-Kutta method [s]; infinite: one step from sample to sample
/// @throws std::invalid_argument when shapes disagree, time does not increase, longest_step <= 0 or
///   an interval needs more than a million steps
InputNodes input_nodes(const Eigen::VectorXd& time, const Eigen::MatrixXd& u, InputPath path,
                       double longest_step);

/// Memory of an evaluation, one per thread; parameters are those last set.
struct ModelMemory {
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  TapeMemory rates, rate_slopes, output_slopes;
  Eigen::VectorXd x, f, sum;  ///< nx
  Rows J, S, K, slope_sum;    ///< nx x (nx + np): of a stage; of the state, the stage, their sum
  Rows stage;                 ///< nx x (nx + np)
  Eigen::VectorXd y;          ///< ny
  Rows y_slopes;              ///< ny x (nx + np)
};
ModelMemory make_memory(const NonlinearModel& model);

/// @param p  parameters, SI
void set_parameters(const NonlinearModel& model, ModelMemory& memory,
                    const Eigen::Ref<const Eigen::VectorXd>& p);

/// Moves x from sample k to sample k + 1, 0-based: in continuous time by the classical fourth-order
/// Runge-Kutta method, in discrete time by f with the inputs at sample k. What overflows or leaves
/// a function's domain becomes infinite or NaN; the caller looks.
void step(const NonlinearModel& model, ModelMemory& memory, const InputNodes& inputs,
          Eigen::Index k, Eigen::Ref<Eigen::VectorXd> x);

/// The same with exact derivatives of the discrete step: the linearised equations go through the
/// same Runge-Kutta steps.
/// @param by_x  nx x nx, written: d x(k+1) / d x(k)
/// @param by_p  nx x np, written: d x(k+1) / d p, x(k) given
void step(const NonlinearModel& model, ModelMemory& memory, const InputNodes& inputs,
          Eigen::Index k, Eigen::Ref<Eigen::VectorXd> x, Eigen::Ref<Eigen::MatrixXd> by_x,
          Eigen::Ref<Eigen::MatrixXd> by_p);

/// Outputs at a sample, with exact derivatives.
/// @param u  inputs there; @param time  [s]; @param y  ny; by_x ny x nx; by_p ny x np: written
void observe(const NonlinearModel& model, ModelMemory& memory,
             const Eigen::Ref<const Eigen::VectorXd>& x, const Eigen::Ref<const Eigen::VectorXd>& u,
             double time, Eigen::Ref<Eigen::VectorXd> y, Eigen::Ref<Eigen::MatrixXd> by_x,
             Eigen::Ref<Eigen::MatrixXd> by_p);

}  // namespace identikal
