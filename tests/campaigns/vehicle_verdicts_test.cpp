#include "tests/campaigns/vehicle_verdicts.h"

#include <cstdio>

#include <gtest/gtest.h>

namespace identikal {
namespace {

// At a rate of wrong results of 2 %, more than 1 of 25 comes in 9 % of such tests; the seeds are
// fixed. VehicleVerdictsStudy has twice as many, and thousands.
TEST(VehicleVerdicts, AreRightForMost) {
  const VehicleVerdicts right = judge_vehicle_drives(50'000, 25, 0);
  const VehicleVerdicts one = judge_vehicle_drives(51'000, 25, 1);
  std::puts(in_words("no fault", right).c_str());
  std::puts(in_words("one fault", one).c_str());
  EXPECT_LE(right.ok_wrong, 1);
  EXPECT_GE(right.ok_right, 15);
  // Asked are 2 % of the wrong: docs/when-is-it-ok.md says what is missing.
  EXPECT_LE(one.ok_wrong, one.ok_right / 4);
}

}  // namespace
}  // namespace identikal
