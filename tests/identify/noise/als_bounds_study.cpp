// Autocovariance least squares within bounds, on as many problems as fit into a night.
#include <cstdio>

#include <gtest/gtest.h>

#include "tests/support/bounded_als.h"

namespace identikal {
namespace {

TEST(BoundedAls, EndsAtTheLeastMisfitOfTenThousand) {
  const BoundedAls found = judge_bounded_als(10'000, 1'000'000);
  std::printf("%d solved, %d at a bound, conditions to %.1e; %d not converged\n", found.solved,
              found.at_bound, found.worst, found.not_converged);
  EXPECT_EQ(found.outside, 0);
  EXPECT_EQ(found.not_converged, 0) << found.why;
  EXPECT_LT(found.refused, found.solved / 50);
  EXPECT_GT(found.at_bound, 5000);
  EXPECT_LT(found.worst, 1e-4);
}

}  // namespace
}  // namespace identikal
