#include "lib/base/quantile.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

namespace identikal {
namespace {

TEST(Quantile, IsHyndmanAndFansTypeSeven) {
  // numpy.quantile(x, p) and R's quantile(x, p).
  const std::vector<double> x{9.0, 1.0, 7.5, 2.0, 4.0, 4.0};
  EXPECT_DOUBLE_EQ(quantile(x, 0.0), 1.0);
  EXPECT_DOUBLE_EQ(quantile(x, 0.1), 1.5);
  EXPECT_DOUBLE_EQ(quantile(x, 0.25), 2.5);
  EXPECT_DOUBLE_EQ(quantile(x, 0.5), 4.0);
  EXPECT_DOUBLE_EQ(quantile(x, 0.75), 6.625);
  EXPECT_DOUBLE_EQ(quantile(x, 0.95), 8.625);
  EXPECT_DOUBLE_EQ(quantile(x, 1.0), 9.0);
  EXPECT_DOUBLE_EQ(quantile({3.0, 1.0}, 0.5), 2.0);
}

TEST(Quantile, OfOneOfNoneAndOfInfinities) {
  EXPECT_EQ(quantile({5.0}, 0.3), 5.0);
  EXPECT_TRUE(std::isnan(quantile({}, 0.5)));
  constexpr double kInf = std::numeric_limits<double>::infinity();
  EXPECT_EQ(quantile({-kInf, 1.0, kInf, kInf}, 1.0 / 3.0), 1.0);
  EXPECT_EQ(quantile({kInf, kInf, kInf}, 0.3), kInf);
}

}  // namespace
}  // namespace identikal
