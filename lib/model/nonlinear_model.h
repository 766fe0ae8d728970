// How does a state move that formulas describe?
#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "lib/base/interpolation.h"
#include "lib/formula/expression.h"
#include "lib/formula/formula_graph.h"
#include "lib/formula/tape.h"

namespace identikal {

/// What was written. The formulas' symbols are numbered: states, inputs, parameters, the time, then
/// the definitions, each of which may use those before it.
struct ModelFormulas {
  int states = 0, inputs = 0, parameters = 0;
  std::vector<Expression> definitions;
  std::vector<Expression> dynamics;  ///< per state: x' = f(x, u, p, t) or x(t+1) = f(x, u, p, t)
  std::vector<Expression> outputs;   ///< y = h(x, u, p, t)
  /// Per state, what is added to it at a sample, as soon as that has been measured: d(x, u, p, t).
  /// Empty: nothing.
  std::vector<Expression> doses;
  bool continuous = true;
  /// An input that is late by a parameter tau: the formulas' symbol of it stands for
  ///
  ///   u - u' tau,
  ///
  /// where at tau, u is to be U(t - tau) + U'(t - tau) tau of the input U(t) and the further input
  /// u' is U'(t - tau): then value and first derivatives by tau are those of U(t - tau), and so are
  /// the second ones that a filter needs.
  struct LateInput {
    int input = 0, slope = 0;  ///< of the inputs, 0-based
    int parameter = 0;         ///< 0-based
  };
  std::vector<LateInput> late;
};

/// How often f and h are derived. A filter's covariance needs the first derivatives; the exact
/// gradient of what it computes from them needs the second.
enum class Derivatives { first, second };

/// The formulas as nodes of one graph, with the definitions put in. Symbols are states, inputs,
/// parameters, which are held, and the time.
struct FormulaNodes {
  FormulaGraph graph;
  std::vector<FormulaGraph::Id> dynamics, outputs;
  int states = 0, inputs = 0, parameters = 0;
  bool continuous = true;
  std::vector<FormulaGraph::Id> doses = {};
};
FormulaNodes insert_formulas(const ModelFormulas& formulas);

/// Where the derivatives of several formulas by z = [x; those of p that are unknown] may differ from
/// zero, as most of most models do not.
struct FormulaSlopes {
  struct Entry {
    Eigen::Index row, column;
  };
  struct SecondEntry {
    Eigen::Index row, column, by;
  };
  std::vector<Entry> wrt_x, wrt_z;  ///< row by row
  // Derivatives::second:
  std::vector<Entry> curved;        ///< those by x that z moves
  std::vector<SecondEntry> second;  ///< d2/(dx_column dz_by) of them, one after the other
  Tape tape;                        ///< values, `wrt_z` and `second`
};

/// The same, ready to be evaluated.
struct NonlinearModel {
  Eigen::Index states = 0, inputs = 0, parameters = 0, outputs = 0;
  Eigen::Index columns = 0;  ///< parameters that f and h are differentiated with respect to
  /// Per parameter p_i: its place among those, 0-based, or one of the two below.
  std::vector<Eigen::Index> column;
  static constexpr Eigen::Index kInNoFormula = -1, kKnown = -2;
  bool continuous = true;
  /// df/dx depends on the parameters alone; and so does all of f but for x.
  bool linear_in_state = false, autonomous = false;
  /// f = A(p) x + B(p) u + c(p).
  bool affine = false;
  Derivatives order = Derivatives::first;  ///< that the tapes below can give
  Tape rates;                              ///< f
  /// f, h and their Jacobians with respect to z = [x; those of p that `column` counts].
  Tape rate_jacobian, output_jacobian;
  FormulaSlopes rate, output;
  Tape doses;  ///< with derivatives by z; of no values: no doses
  bool doses_move_with_state = false;
};

/// @param known  per parameter: nothing is differentiated with respect to it, which costs time;
/// empty: none
/// @throws std::invalid_argument unless there is a formula per state, and when the length of known
/// differs; FormulaError when the derivatives are too large
///
/// Example:
///
///     const std::vector<std::string> names{"x", "tau", "t"};  // state, parameter, time
///     ModelFormulas formulas{.states = 1, .parameters = 1};
///     formulas.dynamics = {parse_expression("-x/tau", names)};
///     formulas.outputs = {parse_expression("hypot(x, 2)", names)};
///     const NonlinearModel distance = make_nonlinear_model(formulas);
NonlinearModel make_nonlinear_model(FormulaNodes nodes, Derivatives order = Derivatives::first,
                                    const std::vector<bool>& known = {});
inline NonlinearModel make_nonlinear_model(const ModelFormulas& formulas,
                                           Derivatives order = Derivatives::first,
                                           const std::vector<bool>& known = {}) {
  return make_nonlinear_model(insert_formulas(formulas), order, known);
}

/// What inputs do between samples.
enum class InputPath {
  constant,  ///< u(t) until the next sample: zero-order hold
  linear,    ///< straight to the next sample: first-order hold
  pchip,     ///< a smooth curve that keeps the shape of the data (lib/base/interpolation.h)
};

/// The inputs where a Runge-Kutta method needs them: for every interval between two samples, at the
/// begin, middle and end of each of its steps.
struct InputNodes {
  Eigen::VectorXd time;             ///< N samples [s]
  std::vector<int> steps;           ///< N - 1
  std::vector<Eigen::Index> first;  ///< column of an interval's begin
  Eigen::MatrixXd u;                ///< nu x sum(2 steps + 1)
  /// nu x N, as given: what the outputs at a sample see, and f in discrete time. An input held
  /// constant takes its last value at the last sample only, where no interval begins.
  Eigen::MatrixXd at_sample;
  /// > 0: steps are chosen during the integration, see controlled_nodes().
  double tolerance = 0.0;
  bool straight = true;       ///< InputPath::constant or linear
  std::vector<Pchip> curves;  ///< of those, per input; empty: straight between an interval's ends
  /// From this sample on, 0-based, the state has come to rest under the sample's inputs
  /// (lib/model/equilibrium.h), however long before it was elsewhere. -1: nowhere.
  Eigen::Index at_rest = -1;
};

/// Steps of the Runge-Kutta method between two samples, at most.
inline constexpr int kMostSteps = 1'000'000;

/// @param time          N strictly increasing time stamps [s], any spacing
/// @param u             nu x N, no NaN
/// @param longest_step  of the Runge-Kutta method [s]; infinite: one step from sample to sample
/// @throws std::invalid_argument when shapes disagree, time does not increase, longest_step <= 0 or
///   an interval needs more than kMostSteps
InputNodes input_nodes(const Eigen::VectorXd& time, const Eigen::MatrixXd& u, InputPath path,
                       double longest_step);
/// The same with a number of steps for every interval (lib/nonlinear/integration_steps.h).
/// @param steps  N - 1, each 1 to kMostSteps
InputNodes input_nodes(const Eigen::VectorXd& time, const Eigen::MatrixXd& u, InputPath path,
                       const std::vector<int>& steps);

/// For an integration that chooses its steps: step() then follows the equations, stiff or not, with
/// an error below `tolerance` of a state, or of a thousandth of the largest that it has been, by an
/// implicit method of order 5; across a jump of the rates below 0.1 tolerance^(2/3). Several times
/// as costly as fixed steps where those do; first derivatives only, exact for the steps taken.
///
/// Example:
///
///     const Eigen::VectorXd time = Eigen::VectorXd::LinSpaced(11, 0.0, 10.0);
///     const Eigen::MatrixXd u(0, 11);  // no inputs
///     const InputNodes inputs = controlled_nodes(time, u, InputPath::linear, 1e-9);
///
/// @param tolerance  @throws std::invalid_argument unless it lies between 1e-13 and 1e-2, and as
///   input_nodes()
InputNodes controlled_nodes(const Eigen::VectorXd& time, const Eigen::MatrixXd& u, InputPath path,
                            double tolerance);

/// What controlled steps remember from interval to interval.
struct StepControl {
  Eigen::Index sample = -1;  ///< where the next interval begins
  double step = 0.0;         ///< [s]
  Eigen::VectorXd largest;   ///< |x_i| so far
};

/// Derivatives of a vector v, of n numbers, that follows from x and p. Those by p_i are in the
/// column model.column[i].
struct Jacobian {
  Eigen::MatrixXd wrt_x;  ///< n x nx
  Eigen::MatrixXd wrt_p;  ///< n x model.columns
  /// n nx x (nx + columns), with Derivatives::second: column l is d wrt_x / d [x; p]_l, column by
  /// column (reshaped(n, nx)).
  Eigen::MatrixXd wrt_x_jacobian;
};

/// What white noise of density Q does to the state from one sample to the next, in continuous time:
///
///   W = int Phi(t(k+1), s) Q Phi(t(k+1), s)' ds   from   W' = f_x W + W f_x' + Q,  W = 0
///
/// along the trajectory without noise, which goes through the Runge-Kutta steps with the state and
/// so has their order. Source: Jazwinski (1970), section 4.9. Symmetric matrices, column by column.
struct Gramians {
  Eigen::MatrixXd densities;  ///< nx^2 x m: Q_j
  Eigen::MatrixXd values;     ///< nx^2 x m, written: W_j
  /// nx^2 x (nx + columns), written with Derivatives::second: d W_1 / d [x; p]
  Eigen::MatrixXd jacobian;
};

/// A step that was made, of a model that is linear in its state: every other over an interval of
/// this length has the same slopes and Gramians.
struct RepeatedStep {
  double interval = 0.0;  ///< [s]
  int steps = 0;
  Derivatives order = Derivatives::first;
  Eigen::VectorXd from, to;  ///< the state
  Jacobian slopes;
  Gramians gramians;  ///< without densities: none
};

/// What the Runge-Kutta steps of an interval make of v = [x(k); u(k), u towards k+1] where f is
/// linear in state and inputs, which go straight from one to the other:
///
///   x(k+1) = at_zero + map v,   dx(k+1)/dp = slope_at_zero + sum_j v_j slopes_j
struct AffineStep {
  double interval = 0.0;  ///< [s]
  int steps = 0;
  Eigen::VectorXd at_zero;
  Eigen::MatrixXd map;            ///< nx x (nx + 2 nu); empty: not made yet
  Eigen::MatrixXd slope_at_zero;  ///< nx x columns
  Eigen::MatrixXd slopes;         ///< nx x columns (nx + 2 nu), side by side
};

/// Memory of an evaluation, one per thread; parameters are those last set.
struct ModelMemory {
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  TapeMemory rates, rate_jacobian, output_jacobian, rate_curvature, output_curvature, doses;
  /// At a step's begin, at a stage, its rate and the sum over stages: the state and, as far as they
  /// are requested, its derivatives, one after the other.
  Eigen::VectorXd begin, stage, rate, sum;
  Rows J, H, turned;     ///< derivatives of f with respect to [x; p] at the stage, and of those
                         ///< with respect to x
  Rows densities, half;  ///< of Gramians, and of their rates
  Eigen::VectorXd values, y_values;  ///< of rates_at() and outputs_at()
  Rows y_jacobian;                   ///< ny x (nx + columns)
  Rows y_second;                     ///< ny nx x (nx + columns)
  Eigen::VectorXd dose;              ///< nx
  Rows dose_jacobian;                ///< nx x (nx + columns)
  StepControl control;
  std::vector<RepeatedStep> repeated;  ///< since the parameters were set
  std::vector<AffineStep> affine;      ///< the same
  Eigen::VectorXd v;                   ///< of those
};
ModelMemory make_memory(const NonlinearModel& model);

/// @param p  parameters, SI
void set_parameters(const NonlinearModel& model, ModelMemory& memory,
                    const Eigen::Ref<const Eigen::VectorXd>& p);

/// Formulas and their derivatives at a point, as FormulaSlopes lists them; in the memory that they
/// were evaluated in, until the next call.
struct SlopesAt {
  std::span<const double> values, wrt_z;
  std::span<const double> second;  ///< empty with Derivatives::first
};
/// f and h at a point.
/// @param x, u   nx, nu numbers
/// @param time   [s]
/// @param order  @throws std::invalid_argument when it is beyond the model's
SlopesAt rates_at(const NonlinearModel& model, ModelMemory& memory, Derivatives order,
                  const double* x, const double* u, double time);
SlopesAt outputs_at(const NonlinearModel& model, ModelMemory& memory, Derivatives order,
                    const double* x, const double* u, double time);

/// Moves x from sample k to sample k + 1, 0-based, from x + d(x, u(k), p, t(k)): in continuous time
/// by the classical fourth-order Runge-Kutta method, or as controlled_nodes() says, in discrete
/// time by f with the inputs at sample k; to where it rests where nodes say so. What overflows,
/// leaves a function's domain or comes to no rest becomes infinite or NaN; the caller looks.
/// @param x  nx
/// @throws std::invalid_argument when there is no such sample or the number of inputs differs
void step(const NonlinearModel& model, ModelMemory& memory, const InputNodes& inputs,
          Eigen::Index k, Eigen::Ref<Eigen::VectorXd> x);

/// The same with exact derivatives of x(k+1) by x(k) and p: the linearised equations go through the
/// same Runge-Kutta steps. Those of a model that is linear in its state are made once for every
/// length of an interval.
/// @param jacobian  written; allocates nothing when it has the right shapes
/// @param order     @throws std::invalid_argument when it is beyond the model's
/// @param gramians  null: none; @throws std::invalid_argument in discrete time, without densities,
///   and, as for second derivatives, where steps are controlled, where the state comes to rest, and
///   where doses move with the state
void step(const NonlinearModel& model, ModelMemory& memory, const InputNodes& inputs,
          Eigen::Index k, Eigen::Ref<Eigen::VectorXd> x, Jacobian& jacobian,
          Derivatives order = Derivatives::first, Gramians* gramians = nullptr);

/// Outputs at a sample and their exact derivatives.
/// @param x, u  state and inputs there
/// @param time  [s]
/// @param y     ny, written
/// @param order @throws std::invalid_argument when it is beyond the model's
void observe(const NonlinearModel& model, ModelMemory& memory,
             const Eigen::Ref<const Eigen::VectorXd>& x, const Eigen::Ref<const Eigen::VectorXd>& u,
             double time, Eigen::Ref<Eigen::VectorXd> y, Jacobian& jacobian,
             Derivatives order = Derivatives::first);
/// The outputs alone.
void observe(const NonlinearModel& model, ModelMemory& memory,
             const Eigen::Ref<const Eigen::VectorXd>& x, const Eigen::Ref<const Eigen::VectorXd>& u,
             double time, Eigen::Ref<Eigen::VectorXd> y);

}  // namespace identikal
