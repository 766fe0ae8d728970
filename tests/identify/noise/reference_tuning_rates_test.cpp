// How often is a right model taken for a wrong one, and a wrong one found?
#include <cmath>

#include <gtest/gtest.h>

#include "tests/identify/noise/reference_campaign.h"

namespace identikal {
namespace {

// With a right model a finding in at most 5 % (20 runs: more than 3 in 1 of 60 cases), and values
// within errors; with a wrong one a finding in 90 %, and estimates that are better.
TEST(ReferenceTuning, TellsRightModelsFromWrongOnes) {
  const Rates right = campaign(20, 0.0);
  EXPECT_LE(right.named, 3);
  EXPECT_GE(right.within, 18);
  EXPECT_LT(std::abs(right.gain), 0.02);
  const Rates wrong = campaign(20, 1.0);
  EXPECT_GE(wrong.named, 17);
  EXPECT_GE(wrong.better, 18);
}

}  // namespace
}  // namespace identikal
