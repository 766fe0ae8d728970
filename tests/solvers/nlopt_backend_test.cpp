#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "solvers/solve.h"

namespace identikal {
namespace {

using Eigen::VectorXd;

TEST(SolveWithoutGradient, FindsTheMinimumInsideTheBoxAndOnItsEdge) {
  Minimization problem;
  problem.lower = Eigen::Vector2d(-2.0, -2.0);
  problem.upper = Eigen::Vector2d(2.0, 2.0);
  problem.evaluate = [](const VectorXd& x, double& f, VectorXd* g) {
    EXPECT_EQ(g, nullptr);
    f = 100.0 * std::pow(x[1] - x[0] * x[0], 2) + std::pow(1.0 - x[0], 2);
    return true;
  };
  SolverOptions options;
  options.max_iterations = 1000;
  Solution solution = solve_without_gradient(problem, Eigen::Vector2d(-1.2, 1.0), options);
  EXPECT_TRUE(solution.summary.usable()) << solution.summary.message;
  EXPECT_LT((solution.x - Eigen::Vector2d(1.0, 1.0)).norm(), 1e-3);
  problem.upper = Eigen::Vector2d(0.5, 2.0);
  solution = solve_without_gradient(problem, Eigen::Vector2d(0.0, 0.0), options);
  EXPECT_LT((solution.x - Eigen::Vector2d(0.5, 0.25)).norm(), 1e-3);
}

TEST(SolveWithoutGradient, TakesOneUnknownAndUndefinedValues) {
  Minimization problem;
  problem.lower = VectorXd::Constant(1, 0.0);
  problem.upper = VectorXd::Constant(1, 4.0);
  problem.evaluate = [](const VectorXd& x, double& f, VectorXd*) {
    f = x[0] - std::log(x[0]);
    return x[0] > 0.0;
  };
  const Solution solution = solve_without_gradient(problem, VectorXd::Constant(1, 3.0));
  EXPECT_NEAR(solution.x[0], 1.0, 1e-4);
  EXPECT_THROW(solve_without_gradient(problem, VectorXd::Constant(1, 5.0)), std::invalid_argument);
}

TEST(SolveWithoutGradient, StopsWhenToldWithTheBestSoFar) {
  Minimization problem;
  problem.lower = VectorXd::Constant(1, 0.0);
  problem.upper = VectorXd::Constant(1, 4.0);
  double best = 1e300;
  problem.evaluate = [&](const VectorXd& x, double& f, VectorXd* g) {
    f = std::pow(x[0] - 1.0, 2);
    if (g != nullptr) *g = 2.0 * (x - VectorXd::Ones(1));
    best = std::min(best, f);
    return true;
  };
  for (const bool gradient : {false, true}) {
    best = 1e300;
    SolverOptions options;
    int calls = 0;
    options.progress = [&](int evaluation, double f) {
      EXPECT_EQ(evaluation, ++calls);
      EXPECT_EQ(f, best);
      return calls < (gradient ? 2 : 5);
    };
    const VectorXd start = VectorXd::Constant(1, 3.0);
    const Solution solution =
        gradient ? solve(problem, start, options) : solve_without_gradient(problem, start, options);
    EXPECT_EQ(solution.summary.termination, Termination::stopped);
    EXPECT_EQ(solution.summary.evaluations, gradient ? 2 : 5);
    EXPECT_EQ(solution.summary.objective, best);
    EXPECT_DOUBLE_EQ(std::pow(solution.x[0] - 1.0, 2), best);
  }
}

}  // namespace
}  // namespace identikal
