// The method of multipliers against the closed solution of a quadratic problem (Karush, Kuhn and
// Tucker).
#include "lib/model/constraints.h"

#include <stdexcept>

#include <Eigen/LU>
#include <gtest/gtest.h>

namespace identikal {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

const std::vector<std::string> kNames{"a", "b", "c"};

Constraints constraints_of(const std::vector<std::string>& texts, std::vector<bool> equality) {
  std::vector<Expression> g;
  for (const std::string& text : texts) g.push_back(parse_expression(text, kNames));
  return make_constraints(g, std::move(equality), texts, 3);
}

// L(p) = -1/2 (p - p0)' I (p - p0), by Newton's steps and the multipliers between them.
struct Quadratic {
  MatrixXd information{{4.0, 1.0, 0.5}, {1.0, 9.0, -1.0}, {0.5, -1.0, 2.0}};
  VectorXd top{{1.0, 2.0, 3.0}};

  VectorXd maximum_under(const Constraints& constraints, Multipliers& multipliers) const {
    VectorXd p = top;
    const ConstraintValues first = constraint_values(constraints, p);
    multipliers.weigh(first.slopes, information);
    for (int round = 0; round < 30; ++round) {
      for (int step = 0; step < 5; ++step) {
        const ConstraintResiduals rows =
            constraint_residuals(constraints, multipliers, constraint_values(constraints, p));
        const VectorXd gradient = -information * (p - top) - rows.slopes.transpose() * rows.r;
        const MatrixXd curvature = information + rows.slopes.transpose() * rows.slopes;
        p += curvature.fullPivLu().solve(gradient);
      }
      const ConstraintValues at = constraint_values(constraints, p);
      const VectorXd tolerances = constraint_tolerances(at, p, at.slopes, information);
      const bool open = update_multipliers(constraints, at.g, tolerances, multipliers);
      multipliers.weigh(at.slopes, information);
      if (!open) break;
    }
    return p;
  }
};

TEST(Constraints, AnEqualityHasTheClosedSolution) {
  const Quadratic problem;
  const Constraints sum = constraints_of({"a + 2*b - 3"}, {true});
  Multipliers multipliers;
  const VectorXd p = problem.maximum_under(sum, multipliers);
  // [I A'; A 0] [p; l] = [I p0; 3]
  MatrixXd K = MatrixXd::Zero(4, 4);
  K.topLeftCorner(3, 3) = problem.information;
  const VectorXd A{{1.0, 2.0, 0.0}};
  K.topRightCorner(3, 1) = A;
  K.bottomLeftCorner(1, 3) = A.transpose();
  VectorXd right(4);
  right << problem.information * problem.top, 3.0;
  const VectorXd solution = K.fullPivLu().solve(right);
  EXPECT_TRUE(p.isApprox(solution.head(3), 1e-7)) << p.transpose();
  EXPECT_NEAR(multipliers.l[0], solution[3], 1e-6);
  EXPECT_NEAR(p[0] + 2.0 * p[1], 3.0, 1e-7);
  // Twice what the constraint costs is the statistic that tests it: L is quadratic.
  const VectorXd away = p - problem.top;
  EXPECT_NEAR(multipliers.l[0] * multipliers.l[0] * multipliers.variance[0],
              away.dot(problem.information * away), 1e-6);
}

TEST(Constraints, InequalitiesHoldOrDoNothing) {
  const Quadratic problem;
  Multipliers idle;
  const VectorXd free = problem.maximum_under(constraints_of({"a - b"}, {false}), idle);
  EXPECT_TRUE(free.isApprox(problem.top, 1e-12));
  EXPECT_EQ(idle.l[0], 0.0);
  Multipliers holds, same;
  const VectorXd p = problem.maximum_under(constraints_of({"c - b"}, {false}), holds);
  const VectorXd equal = problem.maximum_under(constraints_of({"c - b"}, {true}), same);
  EXPECT_TRUE(p.isApprox(equal, 1e-7));
  EXPECT_GT(holds.l[0], 0.0);
}

TEST(Constraints, SlopesAreExactAndShapesAreChecked) {
  const Constraints product = constraints_of({"a*b^2 - c", "a"}, {true, false});
  EXPECT_EQ(product.equalities(), 1);
  const ConstraintValues at = constraint_values(product, VectorXd{{2.0, 3.0, 5.0, 7.0}});
  EXPECT_EQ(at.g[0], 13.0);
  EXPECT_EQ(MatrixXd(at.slopes.row(0)), (MatrixXd{{9.0, 12.0, -1.0, 0.0}}));
  EXPECT_THROW(constraint_values(product, VectorXd{{1.0}}), std::invalid_argument);
  EXPECT_THROW(make_constraints({}, {true}, {}, 3), std::invalid_argument);
}

TEST(Constraints, WhatTheFunctionDoesNotDetermineIsNotTested) {
  Quadratic problem;
  problem.information.row(2).setZero();
  problem.information.col(2).setZero();
  const Constraints sum = constraints_of({"a + c - 1", "a + b - 1"}, {true, true});
  Multipliers multipliers;
  const ConstraintValues at = constraint_values(sum, problem.top);
  multipliers.weigh(at.slopes, problem.information);
  EXPECT_TRUE(std::isnan(multipliers.variance[0]));
  EXPECT_GT(multipliers.variance[1], 0.0);
}

TEST(Constraints, SlopesHaveToFitWhatTheyAreBy) {
  const Constraints sum = constraints_of({"a + 2*b - 3"}, {true});
  const VectorXd p{{1.0, 2.0, 3.0}};
  const ConstraintValues at = constraint_values(sum, p);
  const MatrixXd by_one_coordinate = MatrixXd::Ones(1, 1);
  EXPECT_GT(constraint_tolerances(at, p, by_one_coordinate, MatrixXd::Ones(1, 1))[0], 0.0);
  EXPECT_THROW(
      constraint_tolerances({at.g, by_one_coordinate}, p, by_one_coordinate, MatrixXd::Ones(1, 1)),
      std::invalid_argument);
  EXPECT_THROW(constraint_tolerances(at, p, by_one_coordinate, MatrixXd::Identity(2, 2)),
               std::invalid_argument);
}

}  // namespace
}  // namespace identikal
