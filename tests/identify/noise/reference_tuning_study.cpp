// The rates of reference_tuning_rates_test.cpp, of 300 recordings each.
#include <gtest/gtest.h>

#include "tests/identify/noise/reference_campaign.h"

namespace identikal {
namespace {

TEST(ReferenceTuningStudy, TellsRightModelsFromWrongOnes) {
  const Rates right = campaign(300, 0.0);
  EXPECT_LE(right.named, 15);
  EXPECT_GE(right.within, 285);
  const Rates wrong = campaign(300, 1.0);
  EXPECT_GE(wrong.named, 270);
  EXPECT_GE(wrong.better, 285);
}

}  // namespace
}  // namespace identikal
