#include "lib/statistics/paired_correlation.h"

#include <cmath>
#include <limits>
#include <vector>

#include <gtest/gtest.h>

#include "lib/base/constants.h"
#include "lib/base/random.h"

namespace identikal {
namespace {

// Against the definition, mean by mean, over the samples that both have.
TEST(PairedCorrelation, IsThatOfTheSamplesThatAreThere) {
  Random random(1);
  Eigen::VectorXd x(200), y(200);
  for (Eigen::Index i = 0; i < 200; ++i) {
    x[i] = 3.0 + random.normal();
    y[i] = -7.0 - 2.0 * x[i] + random.normal();
    if (i % 7 == 0) x[i] = kNaN;
    if (i % 5 == 0) y[i] = kNaN;
  }
  std::vector<double> a, b;
  for (Eigen::Index i = 0; i < 200; ++i) {
    if (i % 7 == 0 || i % 5 == 0) continue;
    a.push_back(x[i]);
    b.push_back(y[i]);
  }
  const auto n = static_cast<Eigen::Index>(a.size());
  Eigen::VectorXd p = Eigen::Map<Eigen::VectorXd>(a.data(), n);
  Eigen::VectorXd q = Eigen::Map<Eigen::VectorXd>(b.data(), n);
  p.array() -= p.mean();
  q.array() -= q.mean();
  const PairedCorrelation found = paired_correlation(x, y);
  EXPECT_EQ(found.count, n);
  EXPECT_NEAR(found.correlation, p.dot(q) / (p.norm() * q.norm()), 1e-12);
  EXPECT_NEAR(found.slope, q.norm() / p.norm(), 1e-12);
  EXPECT_LT(found.correlation, -0.8);
}

TEST(PairedCorrelation, ALineIsAllOfIt) {
  const Eigen::VectorXd x = Eigen::VectorXd::LinSpaced(10, 1.0, 2.0);
  const PairedCorrelation up = paired_correlation(x, 3.0 * x), down = paired_correlation(x, -x);
  EXPECT_NEAR(up.correlation, 1.0, 1e-12);
  EXPECT_NEAR(up.slope, 3.0, 1e-12);
  EXPECT_NEAR(down.correlation, -1.0, 1e-12);
  EXPECT_NEAR(down.slope, 1.0, 1e-12);
}

TEST(PairedCorrelation, NothingComesOfNothing) {
  const Eigen::VectorXd x = Eigen::VectorXd::LinSpaced(10, 1.0, 2.0);
  const Eigen::VectorXd missing =
      Eigen::VectorXd::Constant(10, std::numeric_limits<double>::quiet_NaN());
  for (const Eigen::VectorXd& y : {Eigen::VectorXd(Eigen::VectorXd::Constant(10, 0.1)), missing}) {
    EXPECT_TRUE(std::isnan(paired_correlation(x, y).correlation));
    EXPECT_TRUE(std::isnan(paired_correlation(y, x).slope));
  }
  EXPECT_EQ(paired_correlation(x, missing).count, 0);
  EXPECT_TRUE(std::isnan(paired_correlation(x.head(1), x.head(1)).correlation));
  EXPECT_EQ(paired_correlation(Eigen::VectorXd(), Eigen::VectorXd()).count, 0);
}

}  // namespace
}  // namespace identikal
