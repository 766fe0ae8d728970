// Is it the density of all samples together, and its gradient that of differences?
#include "identify/filter/likelihood_function.h"

#include <cmath>
#include <stdexcept>

#include <Eigen/Cholesky>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "identify/model/builder.h"
#include "identify/model/recording.h"
#include "lib/base/error.h"
#include "lib/base/random.h"

namespace identikal {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

Model first_order() {
  return linear_model()
      .parameter("a", 0.8)
      .A("a")
      .C(1)
      .process_noise(variance("q", 0.7))
      .measurement_noise(variance("r", 1.3));
}

// y ~ N(0, V), V(i,j) = q a^|i-j| / (1 - a^2) + r [i = j]: the density by dense linear algebra.
double dense(const VectorXd& y, double a, double q, double r) {
  MatrixXd V(y.size(), y.size());
  for (Eigen::Index i = 0; i < y.size(); ++i) {
    for (Eigen::Index j = 0; j < y.size(); ++j) {
      V(i, j) = q * std::pow(a, std::abs(i - j)) / (1.0 - a * a) + (i == j ? r : 0.0);
    }
  }
  const Eigen::LLT<MatrixXd> factor(V);
  const double log_det = 2.0 * factor.matrixLLT().diagonal().array().log().sum();
  return -0.5 *
         (static_cast<double>(y.size()) * std::log(2.0 * M_PI) + log_det + y.dot(factor.solve(y)));
}

TEST(LikelihoodFunction, IsTheDenseDensityWithItsGradient) {
  const VectorXd y = Random(4).normal(60);
  const Model model = first_order();
  LikelihoodFunction likelihood(model, {recording(model, y, 1.0)});
  EXPECT_THAT(likelihood.names(), testing::ElementsAre("a", "q", "r"));
  const VectorXd p = likelihood.start();
  EXPECT_EQ(p, Eigen::Vector3d(0.8, 0.7, 1.3));
  const LikelihoodValue at = likelihood(p);
  ASSERT_TRUE(at.defined);
  EXPECT_NEAR(at.log_likelihood, dense(y, 0.8, 0.7, 1.3), 1e-10);
  for (int i = 0; i < 3; ++i) {
    VectorXd up = p, down = p;
    up[i] += 1e-5;
    down[i] -= 1e-5;
    const double slope =
        (dense(y, up[0], up[1], up[2]) - dense(y, down[0], down[1], down[2])) / 2e-5;
    EXPECT_NEAR(at.gradient[i], slope, 1e-6 * (1.0 + std::abs(slope)));
  }
  EXPECT_EQ(Eigen::LLT<MatrixXd>(at.information).info(), Eigen::Success);
  EXPECT_EQ(likelihood(p, false).log_likelihood, at.log_likelihood);
}

TEST(LikelihoodFunction, SaysWhereItIsNotDefined) {
  const Model model = first_order();
  LikelihoodFunction likelihood(model, {recording(model, Random(4).normal(60), 1.0)});
  EXPECT_FALSE(likelihood(Eigen::Vector3d(0.8, -1.0, 1.3)).defined);
  EXPECT_FALSE(likelihood(Eigen::Vector3d(1.5, 0.7, 1.3)).defined);  // no stationary start
  EXPECT_THROW(likelihood(Eigen::Vector2d(0.8, 0.7)), std::invalid_argument);
  EXPECT_THROW(LikelihoodFunction(model, {}), std::invalid_argument);
}

TEST(LikelihoodFunction, MovesWithItsData) {
  const Model model = first_order();
  LikelihoodFunction one(model, {recording(model, Random(4).normal(60), 1.0)});
  const double before = one(one.start()).log_likelihood;
  LikelihoodFunction other = std::move(one);
  EXPECT_EQ(other(other.start()).log_likelihood, before);
}

}  // namespace
}  // namespace identikal
