// What can be solved, how long to try, and what came of it.
#pragma once

#include <functional>
#include <limits>
#include <string>

#include <Eigen/Core>

#include "lib/base/alignment.h"

namespace identikal {

/// Why a solver stopped.
enum class Termination {
  not_called,
  converged,    ///< one of the tolerances below is met
  no_progress,  ///< no step improves the objective although the tolerances are not met
  iteration_limit,
  time_limit,
  stopped,          ///< by the caller: progress() returned false
  start_undefined,  ///< evaluate() is undefined at the start
};

struct SolverOptions {
  int max_iterations = 200;
  double max_seconds = std::numeric_limits<double>::infinity();
  double function_tolerance = 1e-12;  ///< stop when |df| <= function_tolerance * |f|
  double gradient_tolerance = 1e-10;  ///< stop when max |projected gradient| <= it (least squares)
  double parameter_tolerance =
      1e-10;  ///< stop when |dx| <= parameter_tolerance * (|x| + parameter_tolerance)
  /// Least squares: steps by the Cholesky factor of J'J instead of QR of J; faster where there are many residuals, and with
  /// half as many digits.
  bool normal_equations = false;
  double decrement_tolerance =
      1e-9;  ///< scoring: stop when g' J^-1 g / 2, the gain still expected, is below it
  /// Scoring: a search that comes no further has converged where the gain still expected is below
  /// this; 0: a thousand times decrement_tolerance.
  double acceptable_decrement = 0.0;
  /// Scoring: directions in which the information, scaled to unit diagonal, is below this share of
  /// its largest are not determined, and nothing is expected of them.
  double flat = 1e-9;
  /// Scoring: the curvature is learnt from steps far from the maximum too. Worth it where information
  /// and curvature differ by factors, as of noise that is not what a model says; of least squares
  /// with small residuals it leads astray.
  bool learn_from_afar = false;
  /// Called after every iteration (NLopt: evaluation) with its number and objective; return false
  /// to stop with the best so far.
  std::function<bool(int, double)> progress;
};

struct SolverSummary {
  Termination termination = Termination::not_called;
  std::string message = "solve was not called";
  int iterations = 0;
  int evaluations = 0;
  double initial_objective = std::numeric_limits<double>::quiet_NaN();
  double objective = std::numeric_limits<double>::quiet_NaN();
  /// Scoring: the gain still expected of the point where it ended.
  double expected_gain = 0.0;
  bool usable() const { return termination == Termination::converged; }
};

struct Solution {
  Eigen::VectorXd x;
  SolverSummary summary;
};

/// minimise 1/2 ||r(x)||^2 with lower <= x <= upper.
struct LeastSquares {
  /// r (m) and, when J is not null, dr/dx (m x n, row-major). false = undefined at x, back off.
  using RowMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  std::function<bool(const Eigen::VectorXd& x, Eigen::VectorXd& r, RowMatrix* J)> evaluate;
  Eigen::Index residuals = 0;
  Eigen::VectorXd lower, upper;  ///< n each; +-infinity = free
};

/// minimise f(x) with lower <= x <= upper.
///
/// Example:
///
///     const Minimization bowl{[](const auto& x, double& f, auto* g) {
///       if (g) *g = 2.0 * x;
///       return f = x.squaredNorm(), true;
///     }, Eigen::Vector2d{-1.0, 0.5}, Eigen::Vector2d{1.0, 2.0}};
///     const SolverOptions options{.max_seconds = 10.0, .progress = {}};  // of solve()
struct Minimization {
  /// f and, when g is not null, its gradient (n). false = undefined at x, back off.
  std::function<bool(const Eigen::VectorXd& x, double& f, Eigen::VectorXd* g)> evaluate;
  Eigen::VectorXd lower, upper;
};

}  // namespace identikal
