#include <cstdio>

#include <gtest/gtest.h>

#include "tests/campaigns/vehicle_verdicts.h"

namespace identikal {
namespace {

struct Campaign {
  VehicleVerdicts right, one, two;

  int ok_wrong() const { return one.ok_wrong + two.ok_wrong; }
  int ok() const { return one.ok_right + two.ok_right + ok_wrong(); }
  int wrong() const { return ok_wrong() + one.refused_wrong + two.refused_wrong; }
  // Those that somebody could tell.
  int told_ok_wrong() const {
    return ok_wrong() - one.ok_wrong_unknowable - two.ok_wrong_unknowable;
  }
  int told_wrong() const {
    return wrong() - (ok_wrong() - told_ok_wrong()) - one.refused_wrong_unknowable -
           two.refused_wrong_unknowable;
  }
};

// At a rate of wrong results of 2 %, more than 3 of 50 come in 2 % of such tests; the seeds are
// fixed.
TEST(VehicleVerdictsStudy, FiftyOfEachAreRightForMost) {
  const VehicleVerdicts right = judge_vehicle_drives(50'000, 50, 0);
  const VehicleVerdicts one = judge_vehicle_drives(51'000, 50, 1);
  std::puts(in_words("no fault", right).c_str());
  std::puts(in_words("one fault", one).c_str());
  EXPECT_LE(right.ok_wrong, 3);
  EXPECT_GE(right.ok_right, 30);
  // Asked are 2 % of the wrong: docs/when-is-it-ok.md says what is missing.
  EXPECT_LE(one.ok_wrong, one.ok_right / 4);
}

// A row each as in the table of docs/when-is-it-ok.md, which is of seeds from 400'000, 500'000 and
// 600'000.
Campaign drive_two_thousand(VehicleFitOptions::Structure structure) {
  const Campaign out{judge_vehicle_drives(100'000, 400, 0, structure),
                     judge_vehicle_drives(200'000, 900, 1, structure),
                     judge_vehicle_drives(300'000, 700, 2, structure)};
  std::puts(in_words("no fault", out.right).c_str());
  std::puts(in_words("one fault", out.one).c_str());
  std::puts(in_words("two faults", out.two).c_str());
  EXPECT_LE(out.right.ok_wrong, 0.02 * out.right.drives());
  return out;
}

TEST(VehicleVerdictsStudy, TwoThousandDrivesAsWritten) {
  const Campaign drives = drive_two_thousand(VehicleFitOptions::Structure::as_written);
  EXPECT_GE(drives.right.ok_right, 0.79 * drives.right.drives());  // asked 97 %
  EXPECT_LE(drives.ok_wrong(), 0.30 * drives.wrong());
  EXPECT_LE(drives.told_ok_wrong(), 0.27 * drives.told_wrong());  // asked 2 %
  // Following the findings does not raise the share of wrong results among the ok.
  const int cured_wrong = drives.one.cured_wrong + drives.two.cured_wrong;
  const int cured = drives.one.cured_right + drives.two.cured_right + cured_wrong;
  EXPECT_LE(cured_wrong * drives.ok(), drives.ok_wrong() * cured);
}

TEST(VehicleVerdictsStudy, TwoThousandDrivesWithTheStructureTaken) {
  const Campaign drives = drive_two_thousand(VehicleFitOptions::Structure::automatic);
  EXPECT_GE(drives.right.ok_right, 0.87 * drives.right.drives());  // asked 97 %
  EXPECT_LE(drives.ok_wrong(), 0.355 * drives.wrong());
  EXPECT_LE(drives.told_ok_wrong(), 0.33 * drives.told_wrong());  // asked 2 %
}

}  // namespace
}  // namespace identikal
