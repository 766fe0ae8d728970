#include "solvers/sparse_least_squares.h"

#include <cmath>
#include <limits>
#include <stdexcept>

#include <gtest/gtest.h>

#include "lib/base/random.h"
#include "solvers/solve.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr double kUnbounded = std::numeric_limits<double>::infinity();

/// A random walk x_0 ... x_n-1 with slope p, seen through noise: p in block 0, one block per point.
struct Walk {
  VectorXd y;
  SparseLeastSquares problem;

  explicit Walk(Index n) : y(n) {
    Random random(3);
    double at = 0.0;
    for (Index t = 0; t < n; ++t) {
      y[t] = at + 0.1 * random.normal();
      at += 0.05 + 0.02 * random.normal();
    }
    problem.block_sizes.assign(static_cast<std::size_t>(n) + 1, 1);
    for (Index t = 0; t < n; ++t) {
      if (t > 0) problem.groups.push_back({{0, t, t + 1}, 1});
      problem.groups.push_back({{t + 1}, 1});
    }
    problem.lower = VectorXd::Constant(n + 1, -kUnbounded);
    problem.upper = VectorXd::Constant(n + 1, kUnbounded);
    problem.evaluate = [this, n](const VectorXd& x, VectorXd& r, std::vector<double>* J) {
      Index i = 0;
      std::size_t d = 0;
      const auto put = [&](double value) {
        if (J != nullptr) (*J)[d++] = value;
      };
      for (Index t = 0; t < n; ++t) {
        if (t > 0) {
          r[i++] = (x[t + 1] - x[t] - x[0]) / 0.02;
          for (const double slope : {-50.0, -50.0, 50.0}) put(slope);
        }
        // A curve, so that it takes more than one step.
        r[i++] = (std::sinh(x[t + 1]) - std::sinh(y[t])) / 0.1;
        put(std::cosh(x[t + 1]) / 0.1);
      }
      return true;
    };
  }
  Walk(const Walk&) = delete;
  Walk& operator=(const Walk&) = delete;

  /// The same for the dense solver.
  LeastSquares dense() const {
    LeastSquares out;
    out.residuals = 2 * y.size() - 1;
    out.lower = problem.lower;
    out.upper = problem.upper;
    out.evaluate = [this](const VectorXd& x, VectorXd& r, LeastSquares::RowMatrix* J) {
      std::vector<double> values(static_cast<std::size_t>(4 * y.size() - 3));
      problem.evaluate(x, r, J == nullptr ? nullptr : &values);
      if (J == nullptr) return true;
      J->setZero();
      std::size_t d = 0;
      for (std::size_t g = 0; g < problem.groups.size(); ++g) {
        for (const Index b : problem.groups[g].blocks) (*J)(static_cast<Index>(g), b) = values[d++];
      }
      return true;
    };
    return out;
  }
};

TEST(SparseLeastSquares, AgreesWithTheDenseSolver) {
  Walk walk(40);
  const VectorXd start = VectorXd::Zero(41);
  const Solution sparse = solve(walk.problem, start), dense = solve(walk.dense(), start);
  ASSERT_TRUE(sparse.summary.usable());
  EXPECT_NEAR(sparse.summary.objective, dense.summary.objective, 1e-9);
  EXPECT_LT((sparse.x - dense.x).cwiseAbs().maxCoeff(), 1e-5);
  walk.problem.upper[0] = 0.03;
  const Solution bounded = solve(walk.problem, start);
  EXPECT_DOUBLE_EQ(bounded.x[0], 0.03);
  EXPECT_GT(bounded.summary.objective, sparse.summary.objective);
}

TEST(SparseLeastSquares, SaysWhatItCannotDo) {
  Walk walk(5);
  EXPECT_THROW(solve(walk.problem, VectorXd::Zero(5)), std::invalid_argument);
  walk.problem.lower[2] = 1.0;
  EXPECT_THROW(solve(walk.problem, VectorXd::Zero(6)), std::invalid_argument);
  walk.problem.lower[2] = -kUnbounded;
  walk.problem.groups.push_back({{7}, 1});
  EXPECT_THROW(solve(walk.problem, VectorXd::Zero(6)), std::invalid_argument);
  walk.problem.groups.pop_back();
  walk.problem.evaluate = [](const VectorXd&, VectorXd&, std::vector<double>*) { return false; };
  EXPECT_EQ(solve(walk.problem, VectorXd::Zero(6)).summary.termination,
            Termination::start_undefined);
}

TEST(SparseLeastSquares, EndsAsTheDenseSolverDoes) {
  Walk walk(40);
  const VectorXd start = VectorXd::Zero(41);
  const auto both_end_by = [&](const SolverOptions& options, Termination how) {
    EXPECT_EQ(solve(walk.problem, start, options).summary.termination, how);
    EXPECT_EQ(solve(walk.dense(), start, options).summary.termination, how);
  };
  both_end_by({}, Termination::converged);
  SolverOptions options;
  options.max_iterations = 1;
  both_end_by(options, Termination::iteration_limit);
  options = {};
  options.max_seconds = 0.0;
  both_end_by(options, Termination::time_limit);
  options = {};
  options.progress = [](int iteration, double) { return iteration < 1; };
  both_end_by(options, Termination::stopped);
}

}  // namespace
}  // namespace identikal
