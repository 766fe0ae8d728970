// Second derivatives by differences in which coordinates that have nothing in common move together.
#include "solvers/covariance.h"

#include <cmath>

#include <gtest/gtest.h>

#include "solvers/scoring.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

int evaluations = 0;

// The slope of -1/2 sum_i (x_0 exp(x_i) - i)^2 - 1/4 sum x_i^4: x_0 is in all terms, each other x_i in its own.
bool slope(const VectorXd& x, VectorXd& g) {
  ++evaluations;
  g = -x.array().cube().matrix();
  for (Index i = 1; i < x.size(); ++i) {
    const double e = std::exp(x[i]), r = x[0] * e - static_cast<double>(i);
    g[0] -= r * e;
    g[i] -= r * x[0] * e;
  }
  return true;
}

TEST(ObservedInformation, IsTheSameWhereOwnersMoveTogether) {
  constexpr Index kOwners = 12;
  const VectorXd x = VectorXd::LinSpaced(kOwners + 1, 0.9, 0.2);
  const VectorXd step = VectorXd::Constant(x.size(), 1e-4);
  std::vector<Index> owner{-1};
  for (Index i = 0; i < kOwners; ++i) owner.push_back(i);
  evaluations = 0;
  const auto one_by_one = observed_information(slope, x, step);
  EXPECT_EQ(evaluations, 2 * (kOwners + 1));
  evaluations = 0;
  const auto together = observed_information(slope, x, step, owner);
  EXPECT_EQ(evaluations, 4);
  ASSERT_TRUE(one_by_one && together);
  EXPECT_LT((*one_by_one - *together).cwiseAbs().maxCoeff(), 1e-6);
}

// Steps of many unknowns go by a triangular root: the maximum is that of the same problem in parts.
TEST(ObservedInformation, ASearchOfManyUnknownsEndsWhereItsPartsDo) {
  constexpr Index kMany = 150;
  const VectorXd target = VectorXd::LinSpaced(kMany, -2.0, 3.0);
  LikelihoodProblem problem;
  problem.lower = VectorXd::Constant(kMany, -HUGE_VAL);
  problem.upper = -problem.lower;
  problem.evaluate = [&](const VectorXd& x, double& L, VectorXd* g, MatrixXd* J) {
    const VectorXd r = x.array().sinh().matrix() - target, by = x.array().cosh();
    L = -0.5 * r.squaredNorm();
    if (g != nullptr) *g = -by.cwiseProduct(r);
    if (J != nullptr) *J = by.cwiseAbs2().asDiagonal();
    return true;
  };
  const Solution found = maximise(problem, VectorXd::Zero(kMany));
  ASSERT_TRUE(found.summary.usable()) << found.summary.message;
  EXPECT_LT((found.x.array().sinh().matrix() - target).cwiseAbs().maxCoeff(), 1e-5);
}

}  // namespace
}  // namespace identikal
