// Do the polygons cover what lies above a level, once, and does the line run along it?
#include "studies/contours.h"

#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>

#include <gtest/gtest.h>

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::VectorXd;

// Signed: positive when turned from x to y.
double area(const std::vector<Vector2d>& polygon) {
  double twice = 0.0;
  for (std::size_t k = 0; k < polygon.size(); ++k) {
    const Vector2d &a = polygon[k], &b = polygon[(k + 1) % polygon.size()];
    twice += a.x() * b.y() - a.y() * b.x();
  }
  return 0.5 * twice;
}
double area(const Contour& contour) {
  double sum = 0.0;
  for (const auto& polygon : contour.above) {
    EXPECT_GE(area(polygon), 0.0);
    sum += area(polygon);
  }
  return sum;
}
double length(const Contour& contour) {
  double sum = 0.0;
  for (const auto& [a, b] : contour.line) sum += (b - a).norm();
  return sum;
}

TEST(Contours, OfAPlaneAreExact) {
  const VectorXd x = VectorXd::LinSpaced(7, 0.0, 3.0), y = VectorXd::LinSpaced(5, 0.0, 2.0);
  MatrixXd plane(7, 5);
  for (Index i = 0; i < 7; ++i) {
    for (Index j = 0; j < 5; ++j) plane(i, j) = x[i] + y[j];
  }
  // x + y >= 1.3 leaves a triangle of that side out.
  const Contour c = contour(x, y, plane, 1.3);
  EXPECT_NEAR(area(c), 6.0 - 0.5 * 1.3 * 1.3, 1e-12);
  EXPECT_NEAR(length(c), 1.3 * std::numbers::sqrt2, 1e-12);
  for (const auto& [a, b] : c.line) EXPECT_NEAR((a + b).sum(), 2.6, 1e-12);
  EXPECT_NEAR(area(contour(x, y, plane, -1.0)), 6.0, 1e-12);
  EXPECT_TRUE(contour(x, y, plane, -1.0).line.empty());
  EXPECT_TRUE(contour(x, y, plane, 5.1).above.empty());
}

TEST(Contours, OfAConeAreCircles) {
  const VectorXd x = VectorXd::LinSpaced(81, -1.0, 1.0);
  MatrixXd cone(81, 81);
  for (Index i = 0; i < 81; ++i) {
    for (Index j = 0; j < 81; ++j) cone(i, j) = -std::hypot(x[i], x[j]);
  }
  const Contour c = contour(x, x, cone, -0.6);
  EXPECT_NEAR(area(c), 0.36 * std::numbers::pi, 1e-3);
  EXPECT_NEAR(length(c), 1.2 * std::numbers::pi, 1e-3);
}

TEST(Contours, WhatIsNotFiniteIsLeftOut) {
  const VectorXd x = VectorXd::LinSpaced(4, 0.0, 3.0);
  MatrixXd value = MatrixXd::Ones(4, 4);
  value(0, 0) = std::nan("");
  value(3, 3) = std::numeric_limits<double>::infinity();
  EXPECT_NEAR(area(contour(x, x, value, 0.5)), 7.0, 1e-12);
  EXPECT_THROW(contour(x, x, MatrixXd::Zero(4, 3), 0.0), std::invalid_argument);
  EXPECT_THROW(contour(VectorXd::Ones(1), x, MatrixXd::Zero(1, 4), 0.0), std::invalid_argument);
}

}  // namespace
}  // namespace identikal
