#include <cstdio>

#include <gtest/gtest.h>

#include "tests/campaigns/vehicle_verdicts.h"

namespace identikal {
namespace {

// The table of docs/when-is-it-ok.md.
TEST(VehicleVerdictsStudy, TwoThousandDrives) {
  const VehicleVerdicts right = judge_vehicle_drives(100'000, 400, 0);
  const VehicleVerdicts one = judge_vehicle_drives(200'000, 900, 1);
  const VehicleVerdicts two = judge_vehicle_drives(300'000, 700, 2);
  std::puts(in_words("no fault", right).c_str());
  std::puts(in_words("one fault", one).c_str());
  std::puts(in_words("two faults", two).c_str());
  EXPECT_LE(right.ok_wrong, 0.02 * right.drives());
  EXPECT_GE(right.ok_right, 0.78 * right.drives());  // asked 97 %
  const int wrong = one.ok_wrong + one.refused_wrong + two.ok_wrong + two.refused_wrong;
  EXPECT_LE(one.ok_wrong + two.ok_wrong, 0.33 * wrong);  // asked 2 %
  // Following the findings does not raise the share of wrong results among the ok.
  const int ok = one.ok_right + one.ok_wrong + two.ok_right + two.ok_wrong;
  const int cured_wrong = one.cured_wrong + two.cured_wrong;
  const int cured = one.cured_right + two.cured_right + cured_wrong;
  EXPECT_LE(cured_wrong * ok, (one.ok_wrong + two.ok_wrong) * cured);
}

}  // namespace
}  // namespace identikal
