#include "lib/base/nearest_name.h"

#include <gtest/gtest.h>

namespace identikal {
namespace {

TEST(NearestName, IsAFewEditsAway) {
  EXPECT_EQ(nearest_name("yaw_rat", {"speed", "yaw_rate"}), "yaw_rate");
  EXPECT_EQ(nearest_name("Q", {"r", "q"}), "q");
  EXPECT_EQ(nearest_name("tuen", {"fit", "tune"}), "tune");
  EXPECT_EQ(nearest_name("vz", {"r", "vy"}), "vy");
  EXPECT_EQ(nearest_name("gyro_z_filtered", {"yaw_rate", "speed"}), "");
  EXPECT_EQ(nearest_name("x", {}), "");
}

TEST(NearestName, IsNotOneThatSharesNothing) {
  EXPECT_EQ(nearest_name("x", {"q", "r"}), "");
  EXPECT_EQ(nearest_name("7", {"t"}), "");
  EXPECT_EQ(nearest_name("ab", {"xy"}), "");
  EXPECT_EQ(nearest_name("", {"q", "vy"}), "");
}

TEST(NearestName, AmongEquallyNearOnesHasTheSameEnds) {
  EXPECT_EQ(nearest_name("ax", {"xa", "ab"}), "ab");
  EXPECT_EQ(nearest_name("vat", {"bat", "vbt"}), "vbt");
}

}  // namespace
}  // namespace identikal
