#include <cmath>
#include <limits>
#include <stdexcept>

#include <gtest/gtest.h>

#include "solvers/solve.h"

namespace identikal {
namespace {

using Eigen::VectorXd;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Rosenbrock's valley: minimum 0 at (1, 1).
LeastSquares rosenbrock() {
  LeastSquares problem;
  problem.residuals = 2;
  problem.lower = VectorXd::Constant(2, -kInfinity);
  problem.upper = VectorXd::Constant(2, kInfinity);
  problem.evaluate = [](const VectorXd& x, VectorXd& r, LeastSquares::RowMatrix* J) {
    r << 10.0 * (x[1] - x[0] * x[0]), 1.0 - x[0];
    if (J != nullptr) *J << -20.0 * x[0], 10.0, -1.0, 0.0;
    return true;
  };
  return problem;
}

/// Straight line through three points; the columns differ in scale by 1e6.
LeastSquares line(double slope, double offset) {
  LeastSquares problem;
  problem.residuals = 3;
  problem.lower = VectorXd::Constant(2, -kInfinity);
  problem.upper = VectorXd::Constant(2, kInfinity);
  problem.evaluate = [=](const VectorXd& x, VectorXd& r, LeastSquares::RowMatrix* J) {
    for (int i = 0; i < 3; ++i) {
      r[i] = 1e6 * i * (x[0] - slope) + (x[1] - offset) + (i == 1 ? 0.1 : -0.05);
      if (J != nullptr) J->row(i) << 1e6 * i, 1.0;
    }
    return true;
  };
  return problem;
}

VectorXd at(double a, double b) { return (VectorXd(2) << a, b).finished(); }

TEST(CeresBackend, FindsTheMinimum) {
  const Solution solution = solve(rosenbrock(), at(-1.2, 1.0));
  EXPECT_EQ(solution.summary.termination, Termination::converged) << solution.summary.message;
  EXPECT_TRUE(solution.x.isApprox(at(1.0, 1.0), 1e-9)) << solution.x.transpose();
  EXPECT_NEAR(solution.summary.initial_objective, 0.5 * 24.2, 1e-12);
  EXPECT_LT(solution.summary.objective, 1e-18);
  EXPECT_GT(solution.summary.iterations, 1);
  EXPECT_GT(solution.summary.evaluations, solution.summary.iterations);
}

TEST(CeresBackend, ScalesTheColumns) {
  const Solution solution = solve(line(3e-6, 2.0), at(0.0, 0.0));
  EXPECT_TRUE(solution.summary.usable());
  // As near as the function tolerance asks for: sqrt(1e-12 * 2 f) in the residuals, f = 0.0075.
  EXPECT_NEAR(1e6 * solution.x[0], 3.0, 2e-7);
  EXPECT_NEAR(solution.x[1], 2.0, 2e-7);
}

// The valley cut off at x0 <= 0.5: the minimum lies on the bound, at (0.5, 0.25).
TEST(CeresBackend, EndsOnABoundWithoutCrawling) {
  LeastSquares problem = rosenbrock();
  problem.upper[0] = 0.5;
  for (const VectorXd& start : {at(-1.2, 1.0), at(0.5, 3.0), at(-3.0, -3.0)}) {
    const Solution solution = solve(problem, start);
    EXPECT_EQ(solution.summary.termination, Termination::converged) << solution.summary.message;
    EXPECT_EQ(solution.x[0], 0.5);
    EXPECT_NEAR(solution.x[1], 0.25, 1e-7);  // sqrt(function tolerance * 2 f) / 10, f = 1/8
    EXPECT_LT(solution.summary.iterations, 40);
  }
}

TEST(CeresBackend, LetsACoordinateGoThatStartedOnItsBound) {
  LeastSquares problem = rosenbrock();
  problem.lower << -2.0, -0.5;
  problem.upper << 2.0, 3.0;
  for (const VectorXd& start : {at(-2.0, -0.5), at(2.0, -0.5), at(-2.0, 3.0), at(2.0, 3.0)}) {
    const Solution solution = solve(problem, start);
    EXPECT_TRUE(solution.summary.usable()) << solution.summary.message;
    EXPECT_TRUE(solution.x.isApprox(at(1.0, 1.0), 1e-8)) << solution.x.transpose();
  }
}

TEST(CeresBackend, KeepsACoordinateWithoutRoom) {
  LeastSquares problem = rosenbrock();
  problem.lower[1] = problem.upper[1] = 4.0;
  const Solution solution = solve(problem, at(1.0, 4.0));
  EXPECT_EQ(solution.x[1], 4.0);
  EXPECT_NEAR(solution.x[0], 2.0, 0.01);
  problem.lower[0] = problem.upper[0] = 1.0;
  const Solution fixed = solve(problem, at(1.0, 4.0));
  EXPECT_EQ(fixed.x, at(1.0, 4.0));
  EXPECT_TRUE(fixed.summary.usable()) << fixed.summary.message;
}

TEST(CeresBackend, BacksOffWhereTheModelIsUndefined) {
  LeastSquares problem = rosenbrock();
  const auto inner = problem.evaluate;
  problem.evaluate = [&](const VectorXd& x, VectorXd& r, LeastSquares::RowMatrix* J) {
    if (x[1] < -0.2 || x[1] > 4.5) return false;
    if (x[0] > 1.6) r.setConstant(std::nan(""));  // an evaluation that does not notice itself
    if (x[0] > 1.6) return true;
    return inner(x, r, J);
  };
  const Solution solution = solve(problem, at(-1.2, 1.0));
  EXPECT_TRUE(solution.x.isApprox(at(1.0, 1.0), 1e-8)) << solution.summary.message;
  const Solution nowhere = solve(problem, at(0.0, 5.0));
  EXPECT_EQ(nowhere.summary.termination, Termination::start_undefined);
  EXPECT_FALSE(nowhere.summary.usable());
  EXPECT_EQ(nowhere.x, at(0.0, 5.0));
}

TEST(CeresBackend, StopsWhenTold) {
  SolverOptions options;
  options.max_iterations = 3;
  EXPECT_EQ(solve(rosenbrock(), at(-1.2, 1.0), options).summary.termination,
            Termination::iteration_limit);
  options = {};
  int calls = 0;
  options.progress = [&](int, double) { return ++calls < 4; };
  const Solution stopped = solve(rosenbrock(), at(-1.2, 1.0), options);
  EXPECT_EQ(stopped.summary.termination, Termination::stopped);
  EXPECT_EQ(stopped.summary.message, "stopped by the caller");
  EXPECT_EQ(calls, 4);
  options = {};
  options.max_seconds = 0.0;
  EXPECT_FALSE(solve(rosenbrock(), at(-1.2, 1.0), options).summary.usable());
}

TEST(CeresBackend, RefusesWhatDoesNotFit) {
  LeastSquares problem = rosenbrock();
  EXPECT_THROW(solve(problem, VectorXd::Zero(3)), std::invalid_argument);
  EXPECT_THROW(solve(problem, VectorXd()), std::invalid_argument);
  problem.upper[0] = -5.0;
  EXPECT_THROW(solve(problem, at(0.0, 0.0)), std::invalid_argument);
  problem = rosenbrock();
  EXPECT_THROW(solve(problem, at(std::nan(""), 0.0)), std::invalid_argument);
}

}  // namespace
}  // namespace identikal
