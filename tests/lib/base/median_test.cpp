#include "lib/base/median.h"

#include <gtest/gtest.h>

namespace identikal {
namespace {

TEST(Median, LiesInTheMiddle) {
  EXPECT_EQ(median({3.0, 1.0, 2.0}), 2.0);
  EXPECT_EQ(median({4.0, 1.0, 3.0, 2.0}), 3.0);  // the larger of the two in the middle
}

}  // namespace
}  // namespace identikal
