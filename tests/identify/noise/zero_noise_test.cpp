// Where a standard deviation is zero the likelihood has no slope: is it a maximum there?

#include "identify/noise/internal/zero_noise.h"

#include <cmath>

#include <gtest/gtest.h>

#include "lib/base/constants.h"

namespace identikal {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// Samples of mean square 1 + `more`, whose variance is 1 + s^2: L rises from s = 0 where more > 0.
LikelihoodProblem part_of_a_variance(double more) {
  LikelihoodProblem out;
  out.lower = VectorXd::Zero(1);
  out.upper = VectorXd::Constant(1, kInfinity);
  out.evaluate = [more](const VectorXd& x, double& L, VectorXd* gradient, MatrixXd* information) {
    constexpr double kSamples = 200.0;
    const double v = 1.0 + x[0] * x[0], slope = 2.0 * x[0];
    L = -0.5 * kSamples * (std::log(v) + (1.0 + more) / v);
    if (gradient)
      (*gradient) = VectorXd{{-0.5 * kSamples * (1.0 / v - (1.0 + more) / (v * v)) * slope}};
    if (information) (*information) = MatrixXd{{0.5 * kSamples * slope * slope / (v * v)}};
    return true;
  };
  return out;
}

TEST(ZeroNoise, IsLeftWhereTheLikelihoodRises) {
  const LikelihoodProblem problem = part_of_a_variance(0.25);
  const VectorXd start = VectorXd::Constant(1, 30.0), zero = VectorXd::Zero(1);
  // The search itself stays.
  EXPECT_EQ(maximise(problem, zero, {}).x[0], 0.0);
  const auto higher = off_zero(problem, start, zero);
  ASSERT_TRUE(higher);
  EXPECT_NEAR(maximise(problem, *higher, {}).x[0], 0.5, 1e-6);
}

TEST(ZeroNoise, StaysWhereItIsAMaximum) {
  const VectorXd start = VectorXd::Constant(1, 30.0), zero = VectorXd::Zero(1);
  EXPECT_FALSE(off_zero(part_of_a_variance(-0.1), start, zero));
  EXPECT_FALSE(off_zero(part_of_a_variance(0.25), start, VectorXd::Constant(1, 0.5)));
}

}  // namespace
}  // namespace identikal
