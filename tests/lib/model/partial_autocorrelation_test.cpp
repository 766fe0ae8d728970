#include "lib/model/partial_autocorrelation.h"

#include <cmath>

#include <Eigen/Eigenvalues>
#include <gtest/gtest.h>

#include "lib/base/random.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

VectorXd anywhere(Index p, Random& random) {
  VectorXd out(p);
  for (double& value : out) value = 2.0 * random.uniform() - 1.0;
  return out;
}

double spectral_radius(const VectorXd& phi) {
  MatrixXd companion = MatrixXd::Zero(phi.size(), phi.size());
  companion.row(0) = phi.transpose();
  companion.diagonal(-1).setOnes();
  return companion.eigenvalues().cwiseAbs().maxCoeff();
}

TEST(PartialAutocorrelation, StandForStablePolynomialsAndAllOfThem) {
  Random random(1);
  for (Index p = 1; p <= 6; ++p) {
    for (int k = 0; k < 50; ++k) {
      const VectorXd partial = anywhere(p, random);
      const VectorXd phi = polynomial_coefficients(partial);
      EXPECT_LT(spectral_radius(phi), 1.0);
      const auto back = partial_autocorrelations(phi);
      ASSERT_TRUE(back.has_value());
      EXPECT_LT((*back - partial).cwiseAbs().maxCoeff(), 1e-8);
    }
  }
  EXPECT_FALSE(partial_autocorrelations(Eigen::Vector2d(0.5, 0.6)).has_value());
  EXPECT_FALSE(partial_autocorrelations(VectorXd::Constant(1, 1.0)).has_value());
}

// A first partial autocorrelation of 1 is a root at 1, a second one of -1 a pair on the circle.
TEST(PartialAutocorrelation, ReachTheUnitCircle) {
  const VectorXd difference = polynomial_coefficients(Eigen::Vector3d(1.0, 0.3, -0.2));
  EXPECT_NEAR(difference.sum(), 1.0, 1e-15);
  const VectorXd oscillation = polynomial_coefficients(Eigen::Vector2d(std::cos(0.7), -1.0));
  EXPECT_NEAR(oscillation[0], 2.0 * std::cos(0.7), 1e-15);
  EXPECT_NEAR(oscillation[1], -1.0, 1e-15);
}

TEST(PartialAutocorrelation, HaveExactDerivatives) {
  Random random(2);
  constexpr double kStep = 1e-6;
  const VectorXd partial = anywhere(5, random);
  MatrixXd J;
  polynomial_coefficients(partial, &J);
  for (Index k = 0; k < 5; ++k) {
    const VectorXd step = kStep * VectorXd::Unit(5, k);
    const VectorXd slope =
        (polynomial_coefficients(partial + step) - polynomial_coefficients(partial - step)) /
        (2.0 * kStep);
    EXPECT_LT((J.col(k) - slope).cwiseAbs().maxCoeff(), 1e-9);
  }
}

}  // namespace
}  // namespace identikal
