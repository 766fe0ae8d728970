#include "identify/noise/internal/posterior_grid.h"

#include <cmath>
#include <limits>
#include <numbers>

#include <gtest/gtest.h>

#include "lib/base/random.h"

namespace identikal {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kInfinite = std::numeric_limits<double>::infinity();

VectorXd both(double value) { return VectorXd::Constant(2, value); }

MatrixXd draws_of(const VectorXd& mean, const MatrixXd& covariance) {
  Random random(1);
  const MatrixXd L = semidefinite_factor(covariance);
  MatrixXd out(mean.size(), 300);
  for (Eigen::Index i = 0; i < out.cols(); ++i) out.col(i) = mean + L * random.normal(mean.size());
  return out;
}

LogDensity gaussian(const VectorXd& mean, const MatrixXd& covariance) {
  const MatrixXd precision = covariance.inverse();
  return {[=](const VectorXd& x) { return -0.5 * (x - mean).dot(precision * (x - mean)); },
          VectorXd::Constant(mean.size(), -kInfinite), VectorXd::Constant(mean.size(), kInfinite)};
}

double mean_of(const PosteriorGrid& grid, Eigen::Index i) {
  return grid.coordinates.row(i).dot(grid.weight);
}

// A ridge a thousand times as long as it is wide, across both axes.
TEST(PosteriorGrid, FollowsARidge) {
  const VectorXd mean = Eigen::Vector2d(3.0, -1.0);
  const MatrixXd covariance{{1.0, -0.9999995}, {-0.9999995, 1.0}};
  const auto grid = posterior_grid(gaussian(mean, covariance), draws_of(mean, covariance));
  ASSERT_TRUE(grid);
  EXPECT_NEAR(mean_of(*grid, 0), 3.0, 1e-6);
  EXPECT_NEAR(mean_of(*grid, 1), -1.0, 1e-6);
  const double second =
      (grid->coordinates.row(0).array() - 3.0).square().matrix().dot(grid->weight);
  EXPECT_NEAR(second, 1.0, 1e-5);
  EXPECT_NEAR(grid->log_integral,
              std::log(2.0 * std::numbers::pi) + 0.5 * std::log(covariance.determinant()), 1e-5);
  EXPECT_NEAR(grid->weight.sum(), 1.0, 1e-12);
}

// Half of a Gaussian, and a quarter: bounds that no cell's side lies on.
TEST(PosteriorGrid, StopsAtBounds) {
  LogDensity half = gaussian(VectorXd::Zero(1), MatrixXd::Identity(1, 1));
  half.low[0] = 0.0;
  const auto line = posterior_grid(half, draws_of(VectorXd::Ones(1), MatrixXd::Identity(1, 1)));
  ASSERT_TRUE(line);
  EXPECT_NEAR(line->log_integral, 0.5 * std::log(0.5 * std::numbers::pi), 1e-5);
  EXPECT_NEAR(mean_of(*line, 0), std::sqrt(2.0 / std::numbers::pi), 1e-5);

  const MatrixXd covariance{{1.0, 0.6}, {0.6, 1.0}};
  LogDensity quarter = gaussian(both(0.0), covariance);
  quarter.low = both(0.0);
  const auto grid = posterior_grid(quarter, draws_of(both(0.8), 0.3 * covariance));
  ASSERT_TRUE(grid);
  // Sheppard: the share of the quadrant is 1/4 + asin(rho) / (2 pi).
  const double share = 0.25 + std::asin(0.6) / (2.0 * std::numbers::pi);
  EXPECT_NEAR(grid->log_integral, std::log(2.0 * std::numbers::pi * 0.8 * share), 1e-3);
  EXPECT_GE(grid->coordinates.minCoeff(), 0.0);
}

// From a pilot that knows a tenth of the width, and lies aside.
TEST(PosteriorGrid, GrowsUntilNothingIsLeft) {
  const auto grid = posterior_grid(gaussian(both(0.0), MatrixXd::Identity(2, 2)),
                                   draws_of(both(0.5), 0.01 * MatrixXd::Identity(2, 2)));
  ASSERT_TRUE(grid);
  EXPECT_NEAR(grid->log_integral, std::log(2.0 * std::numbers::pi), 1e-5);
}

TEST(PosteriorGrid, NothingWhereTwoGridsDisagree) {
  // A comb finer than any cell.
  LogDensity comb = gaussian(VectorXd::Zero(1), MatrixXd::Identity(1, 1));
  comb.at = [](const VectorXd& x) { return -0.5 * x.squaredNorm() + 60.0 * std::cos(4e5 * x[0]); };
  EXPECT_FALSE(posterior_grid(comb, draws_of(VectorXd::Zero(1), MatrixXd::Identity(1, 1))));
  comb.at = [](const VectorXd&) { return -kInfinite; };
  EXPECT_FALSE(posterior_grid(comb, draws_of(VectorXd::Zero(1), MatrixXd::Identity(1, 1))));
}

}  // namespace
}  // namespace identikal
