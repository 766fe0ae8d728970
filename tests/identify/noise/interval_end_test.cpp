#include "identify/noise/internal/interval_end.h"

#include <cmath>

#include <gtest/gtest.h>

#include "lib/base/constants.h"

namespace identikal {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kTarget = 1.959964;

// n samples of mean 5 and variance 4, under a Gaussian of mean x0 and variance x1.
struct Gaussian {
  double n = 30.0;
  int evaluations = 0;

  LikelihoodProblem problem() {
    return {[this](const VectorXd& x, double& L, VectorXd* g, MatrixXd* J) {
              ++evaluations;
              const double v = x[1], d = 5.0 - x[0], S = 4.0 + d * d;
              if (!(v > 0.0)) return false;
              L = -0.5 * n * (std::log(v) + S / v);
              if (g) *g = VectorXd{{n * d / v, 0.5 * n * (S / (v * v) - 1.0 / v)}};
              if (J) *J = MatrixXd{{n / v, 0.0}, {0.0, 0.5 * n / (v * v)}};
              return true;
            },
            VectorXd{{-kInfinity, 0.0}}, VectorXd{{kInfinity, kInfinity}}};
  }
  Profiled at(Eigen::Index i) {
    Profiled out{problem(), VectorXd{{5.0, 4.0}}, 0.0, {}, {}, i};
    out.problem.evaluate(out.x, out.L, nullptr, &out.information);
    evaluations = 0;
    return out;
  }
};

TEST(IntervalEnd, OfTheMeanIsThatOfStudent) {
  // The profile of the mean: n/2 log(1 + d^2 / 4) = target^2 / 2.
  Gaussian gaussian;
  const Profiled at = gaussian.at(0);
  const double exact = 2.0 * std::sqrt(std::expm1(kTarget * kTarget / gaussian.n));
  const double first = kTarget * std::sqrt(4.0 / gaussian.n);
  for (const double side : {-1.0, 1.0}) {
    gaussian.evaluations = 0;
    const auto end = end_at_once(at, side * first, kTarget, true);
    ASSERT_TRUE(end);
    EXPECT_NEAR((*end)[0] - 5.0, side * exact, 3e-4 * first);
    EXPECT_LE(gaussian.evaluations, 3);
  }
}

TEST(IntervalEnd, OfTheVarianceSolvesItsProfile) {
  Gaussian gaussian;
  const Profiled at = gaussian.at(1);
  const double first = kTarget * 4.0 * std::sqrt(2.0 / gaussian.n);
  for (const double side : {-1.0, 1.0}) {
    gaussian.evaluations = 0;
    const auto end = end_at_once(at, side * first, kTarget, true);
    ASSERT_TRUE(end);
    const double r = 4.0 / (*end)[1];
    const double drop = 0.5 * gaussian.n * (r - 1.0 - std::log(r));
    EXPECT_NEAR(std::sqrt(2.0 * drop), kTarget, 3e-4);
    EXPECT_LE(gaussian.evaluations, 3);
  }
}

TEST(IntervalEnd, TheOtherEndSparesEvaluations) {
  Gaussian gaussian;
  const Profiled at = gaussian.at(1);
  const double first = kTarget * 4.0 * std::sqrt(2.0 / gaussian.n);
  const auto low = end_at_once(at, -first, kTarget, true);
  ASSERT_TRUE(low);
  const auto alone = end_at_once(at, first, kTarget, true);
  gaussian.evaluations = 0;
  const auto high = end_at_once(at, first, kTarget, true, &*low);
  ASSERT_TRUE(alone && high);
  EXPECT_NEAR((*high)[1], (*alone)[1], 3e-4 * first);
  EXPECT_LE(gaussian.evaluations, 2);
}

TEST(IntervalEnd, IsTheBoundThatComesFirst) {
  Gaussian gaussian;
  Profiled at = gaussian.at(0);
  at.problem.upper[0] = 5.5;
  const auto end = end_at_once(at, 0.7, kTarget, true);
  ASSERT_TRUE(end);
  EXPECT_EQ((*end)[0], 5.5);
}

// Two coordinates along a curved valley, from which plain Newton steps leave.
TEST(IntervalEnd, FollowsACurvedValley) {
  // With b = x1 - x0^2: L = -(x0^2 + 100 b^2) / 2, so that the profile of x0 is -x0^2 / 2.
  Profiled at{
      {[](const VectorXd& x, double& L, VectorXd* g, MatrixXd* J) {
         const double b = x[1] - x[0] * x[0];
         L = -0.5 * (x[0] * x[0] + 100.0 * b * b);
         if (g) *g = VectorXd{{-x[0] + 200.0 * b * x[0], -100.0 * b}};
         if (J) *J = MatrixXd{{1.0 + 400.0 * x[0] * x[0], -200.0 * x[0]}, {-200.0 * x[0], 100.0}};
         return true;
       },
       VectorXd{{-kInfinity, -kInfinity}}, VectorXd{{kInfinity, kInfinity}}},
      VectorXd{{0.0, 0.0}},
      0.0,
      MatrixXd{{1.0, 0.0}, {0.0, 100.0}},
      {},
      0};
  const auto end = end_at_once(at, kTarget, kTarget, true);
  ASSERT_TRUE(end);
  EXPECT_NEAR((*end)[0], kTarget, 3e-4);
}

}  // namespace
}  // namespace identikal
