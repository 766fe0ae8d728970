// Splines by their values at knots: between them, outside, and how rough they are.
#include "lib/model/spline_curve.h"

#include <cmath>
#include <vector>

#include <Eigen/Dense>
#include <gtest/gtest.h>

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

const std::vector<double> kKnots{0.0, 0.7, 1.5, 2.1, 3.4, 4.0, 5.0};

VectorXd at_knots(double (*f)(double)) {
  VectorXd out(static_cast<Index>(kKnots.size()));
  for (Index i = 0; i < out.size(); ++i) out[i] = f(kKnots[static_cast<std::size_t>(i)]);
  return out;
}

TEST(SplineCurve, IsEveryCubicAndStraightOutside) {
  const auto cubic = [](double z) { return 1.0 - z + 0.5 * z * z * z; };
  const VectorXd f = at_knots(cubic);
  for (double z = 0.0; z <= 5.0; z += 0.13) {
    EXPECT_NEAR(spline_weights(kKnots, z).dot(f), cubic(z), 1e-10) << z;
    EXPECT_NEAR(spline_weights(kKnots, z, true).dot(f), -1.0 + 1.5 * z * z, 1e-10) << z;
  }
  EXPECT_NEAR(spline_weights(kKnots, 7.0).dot(f), cubic(5.0) + 2.0 * (-1.0 + 1.5 * 25.0), 1e-9);
}

TEST(SplineCurve, RoughnessIsTheIntegralOfTheSquaredSecondDerivative) {
  const VectorXd f = at_knots([](double z) { return std::sin(2.0 * z); });
  // By Simpson's rule of second differences, away from the knots' jumps by steps that meet them.
  double sum = 0.0;
  const double h = 1e-3;
  for (double z = 0.5 * h; z < 5.0; z += h) {
    const double d = 1e-4;
    const double second =
        (spline_weights(kKnots, z + d).dot(f) - 2.0 * spline_weights(kKnots, z).dot(f) +
         spline_weights(kKnots, z - d).dot(f)) /
        (d * d);
    sum += h * second * second;
  }
  const MatrixXd R = spline_roughness(kKnots);
  EXPECT_NEAR(f.dot(R * f), sum, 1e-3 * sum);
  const VectorXd line = at_knots([](double z) { return 3.0 - 2.0 * z; });
  EXPECT_LT((R * line).norm(), 1e-10);
  EXPECT_EQ(Eigen::FullPivLU<MatrixXd>(R).setThreshold(1e-10).rank(),
            static_cast<Index>(kKnots.size()) - 2);
}

}  // namespace
}  // namespace identikal
