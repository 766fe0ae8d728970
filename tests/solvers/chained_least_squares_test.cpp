#include "solvers/chained_least_squares.h"

#include <cmath>
#include <cstdio>
#include <limits>
#include <stdexcept>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "lib/base/random.h"
#include "solvers/solve.h"
#include "solvers/sparse_least_squares.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kFree = std::numeric_limits<double>::infinity();

// Two states that turn by an angle p_0 a step and shrink by p_1, seen through a sine, on and on.
struct Turning {
  MatrixXd y;
  ChainedLeastSquares problem;

  explicit Turning(Index n) : y(1, n) {
    Random random(5);
    Eigen::Vector2d x(1.0, 0.3);
    for (Index t = 0; t < n; ++t) {
      y(0, t) = std::sin(x[0]) + 0.02 * random.normal();
      x = turned(x, 0.2, 0.99) + 0.01 * Eigen::Vector2d(random.normal(), random.normal());
    }
    problem.links = n;
    problem.state = problem.shared = 2;
    problem.lower = VectorXd::Constant(2, -kFree);
    problem.upper = VectorXd::Constant(2, kFree);
    problem.evaluate = [this](const MatrixXd& states, const VectorXd& p, bool with_derivatives,
                              std::vector<ChainLink>& links) {
      for (Index t = 0; t < y.cols(); ++t) write(states, p, with_derivatives, t, links);
      return true;
    };
  }
  Turning(const Turning&) = delete;
  Turning& operator=(const Turning&) = delete;

  static Eigen::Vector2d turned(const Eigen::Vector2d& x, double angle, double shrinks) {
    return shrinks * (Eigen::Rotation2Dd(angle) * x);
  }

  void write(const MatrixXd& states, const VectorXd& p, bool with_derivatives, Index t,
             std::vector<ChainLink>& links) const {
    ChainLink& link = links[static_cast<std::size_t>(t)];
    const bool last = t + 1 == y.cols();
    const Index rows = last ? 1 : 3;
    link.residuals.resize(rows);
    link.residuals[0] = (std::sin(states(0, t)) - y(0, t)) / 0.02;
    const Eigen::Vector2d x = states.col(t);
    const Eigen::Vector2d to = turned(x, p[0], p[1]);
    if (!last) link.residuals.tail(2) = (to - states.col(t + 1)) / 0.01;
    if (!with_derivatives) return;
    link.by_state.setZero(rows, 2);
    link.by_next_state.setZero(rows, 2);
    link.by_shared.setZero(rows, 2);
    link.by_state(0, 0) = std::cos(states(0, t)) / 0.02;
    if (last) return;
    link.by_state.bottomRows(2) = p[1] * Eigen::Rotation2Dd(p[0]).toRotationMatrix() / 0.01;
    link.by_next_state.bottomRows(2) = -MatrixXd::Identity(2, 2) / 0.01;
    link.by_shared.col(0).tail(2) = turned(x, p[0] + M_PI / 2.0, p[1]) / 0.01;
    link.by_shared.col(1).tail(2) = turned(x, p[0], 1.0) / 0.01;
  }

  // The same without any structure: x = [p; states].
  LeastSquares dense() {
    LeastSquares out;
    const Index n = y.cols(), size = 2 + 2 * n;
    out.residuals = 3 * n - 2;
    out.lower = VectorXd::Constant(size, -kFree);
    out.upper = VectorXd::Constant(size, kFree);
    out.lower.head(2) = problem.lower;
    out.upper.head(2) = problem.upper;
    out.evaluate = [this, n](const VectorXd& x, VectorXd& r, LeastSquares::RowMatrix* J) {
      std::vector<ChainLink> links(static_cast<std::size_t>(n));
      const MatrixXd states = x.tail(2 * n).reshaped(2, n);
      problem.evaluate(states, x.head(2), true, links);
      r.resize(3 * n - 2);
      if (J != nullptr) J->setZero(r.size(), x.size());
      Index row = 0;
      for (Index t = 0; t < n; ++t) {
        const ChainLink& link = links[static_cast<std::size_t>(t)];
        const Index rows = link.residuals.size();
        r.segment(row, rows) = link.residuals;
        if (J != nullptr) {
          J->block(row, 0, rows, 2) = link.by_shared;
          J->block(row, 2 + 2 * t, rows, 2) = link.by_state;
          if (t + 1 < n) J->block(row, 4 + 2 * t, rows, 2) = link.by_next_state;
        }
        row += rows;
      }
      return true;
    };
    return out;
  }

  MatrixXd start() const {
    MatrixXd out = MatrixXd::Zero(2, y.cols());
    out.row(0) = y;
    return out;
  }
};

TEST(ChainedLeastSquares, FindsWhatTheDenseSolverFinds) {
  Turning turning(40);
  const VectorXd p = Eigen::Vector2d(0.15, 0.9);
  const ChainedSolution found = solve(turning.problem, turning.start(), p);
  ASSERT_TRUE(found.summary.usable()) << found.summary.message;
  VectorXd start(2 + 80);
  start << p, turning.start().reshaped();
  const Solution dense = solve(turning.dense(), start);
  EXPECT_NEAR(found.summary.objective, dense.summary.objective, 1e-7);
  EXPECT_NEAR((found.shared - dense.x.head(2)).norm(), 0.0, 1e-5);
  EXPECT_NEAR((found.states.reshaped() - dense.x.tail(80)).norm(), 0.0, 1e-3);
}

TEST(ChainedLeastSquares, InformationOfTheSharedIsTheSchurComplement) {
  Turning turning(30);
  const ChainedSolution found = solve(turning.problem, turning.start(), Eigen::Vector2d(0.15, 0.9));
  VectorXd end(2 + 60);
  end << found.shared, found.states.reshaped();
  VectorXd r;
  LeastSquares::RowMatrix J;
  turning.dense().evaluate(end, r, &J);
  const MatrixXd all = J.transpose() * J;
  const MatrixXd marginal = all.topLeftCorner(2, 2) -
                            all.topRightCorner(2, 60) * all.bottomRightCorner(60, 60).ldlt().solve(
                                                            MatrixXd(all.bottomLeftCorner(60, 2)));
  const MatrixXd R = found.root_information;
  EXPECT_LT((R.transpose() * R - marginal).norm(), 1e-7 * marginal.norm());
}

TEST(ChainedLeastSquares, SharedUnknownsStayWithinTheirBounds) {
  Turning turning(40);
  turning.problem.upper[0] = 0.19;
  const VectorXd p = Eigen::Vector2d(0.1, 0.9);
  const ChainedSolution found = solve(turning.problem, turning.start(), p);
  ASSERT_TRUE(found.summary.usable()) << found.summary.message;
  EXPECT_EQ(found.shared[0], 0.19);
  VectorXd start(2 + 80);
  start << p, turning.start().reshaped();
  const Solution dense = solve(turning.dense(), start);
  EXPECT_NEAR(found.summary.objective, dense.summary.objective, 1e-5);
  EXPECT_NEAR(found.shared[1], dense.x[1], 1e-4);
}

TEST(ChainedLeastSquares, WithoutStatesItIsLeastSquares) {
  ChainedLeastSquares line{
      1, 0, 1, {}, VectorXd::Constant(1, -kFree), VectorXd::Constant(1, kFree)};
  line.evaluate = [](const MatrixXd&, const VectorXd& p, bool, std::vector<ChainLink>& links) {
    links[0] = {Eigen::Vector3d(p[0] - 1.1, 2.0 * p[0] - 1.9, 3.0 * p[0] - 3.2), MatrixXd(3, 0),
                MatrixXd(3, 0), Eigen::Vector3d(1.0, 2.0, 3.0)};
    return true;
  };
  const ChainedSolution found = solve(line, MatrixXd(0, 1), VectorXd::Zero(1));
  // Its tolerance is 1e-12 of the sum of squares, so 1e-7 of p.
  EXPECT_NEAR(found.shared[0], (1.1 + 2.0 * 1.9 + 3.0 * 3.2) / 14.0, 1e-7);
  EXPECT_NEAR(found.root_information(0, 0) * found.root_information(0, 0), 14.0, 1e-10);
}

// A valley along y = x^3 + sin 3x whose walls are 1e5 times as steep as its floor.
TEST(ChainedLeastSquares, FollowsANarrowValleyThatBends) {
  ChainedLeastSquares valley;
  valley.links = 1;
  valley.shared = 2;
  valley.lower = VectorXd::Constant(2, -kFree);
  valley.upper = VectorXd::Constant(2, kFree);
  valley.evaluate = [](const MatrixXd&, const VectorXd& p, bool with_derivatives,
                       std::vector<ChainLink>& links) {
    constexpr double kSteep = 1e5;
    const double x = p[0], y = p[1];
    ChainLink& link = links[0];
    link.residuals = Eigen::Vector2d(1.0 - x, kSteep * (y - x * x * x - std::sin(3.0 * x)));
    link.by_state = link.by_next_state = MatrixXd(2, 0);
    if (!with_derivatives) return true;
    link.by_shared =
        MatrixXd{{-1.0, 0.0}, {-kSteep * (3.0 * x * x + 3.0 * std::cos(3.0 * x)), kSteep}};
    return true;
  };
  SolverOptions options;
  options.max_iterations = 10000;
  const VectorXd start{{-2.0, -8.0 + std::sin(-6.0)}};
  const ChainedSolution end = solve(valley, MatrixXd(0, 1), start, options);
  std::printf("a bent valley: %d steps, %d evaluations\n", end.summary.iterations,
              end.summary.evaluations);
  EXPECT_NEAR(end.shared[0], 1.0, 1e-6);
  EXPECT_LT(end.summary.iterations, 1000);  // 10,684 by steps that are straight
}

TEST(ChainedLeastSquares, RefusesWhatDoesNotFit) {
  Turning turning(5);
  EXPECT_THROW(solve(turning.problem, MatrixXd::Zero(2, 4), VectorXd::Zero(2)),
               std::invalid_argument);
  turning.problem.lower[0] = 1.0;
  EXPECT_THROW(solve(turning.problem, turning.start(), VectorXd::Zero(2)), std::invalid_argument);
  turning.problem.lower[0] = -1.0;
  turning.problem.evaluate = [](const auto&, const auto&, bool, auto&) { return false; };
  EXPECT_EQ(solve(turning.problem, turning.start(), VectorXd::Zero(2)).summary.termination,
            Termination::start_undefined);
}

}  // namespace
}  // namespace identikal
