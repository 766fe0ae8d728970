// Are the numbers at an axis round, few, inside and told apart?
#include "studies/axis_ticks.h"

#include <cmath>
#include <limits>
#include <stdexcept>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace identikal {
namespace {

using ::testing::ElementsAre;

std::vector<std::string> labels(const AxisTicks& ticks) {
  std::vector<std::string> out;
  for (const auto& tick : ticks.major) out.push_back(tick.label);
  return out;
}

TEST(AxisTicks, LinearOnesAreRoundAndWrittenAlike) {
  EXPECT_THAT(labels(linear_ticks(0.0, 4.0, 8)),
              ElementsAre("0.0", "0.5", "1.0", "1.5", "2.0", "2.5", "3.0", "3.5", "4.0"));
  EXPECT_THAT(labels(linear_ticks(0.0, 4.0, 7)), ElementsAre("0", "1", "2", "3", "4"));
  EXPECT_THAT(labels(linear_ticks(-0.25, 0.3, 6)),
              ElementsAre("−0.2", "−0.1", "0.0", "0.1", "0.2", "0.3"));
  EXPECT_THAT(labels(linear_ticks(0.25, 20.0, 8)), ElementsAre("5", "10", "15", "20"));
  EXPECT_THAT(labels(linear_ticks(0.0, 3e-4, 3)), ElementsAre("0", "1·10⁻⁴", "2·10⁻⁴", "3·10⁻⁴"));
  EXPECT_THAT(labels(linear_ticks(1.5e6, 1.50002e6, 2)),
              ElementsAre("1.50000·10⁶", "1.50001·10⁶", "1.50002·10⁶"));
}

TEST(AxisTicks, MinorOnesDivideTheMajorOnes) {
  EXPECT_THAT(
      linear_ticks(0.0, 2.0, 2).minor,
      ElementsAre(0.0, ::testing::DoubleNear(0.2, 1e-12), ::testing::DoubleNear(0.4, 1e-12),
                  ::testing::DoubleNear(0.6, 1e-12), ::testing::DoubleNear(0.8, 1e-12), 1.0,
                  ::testing::DoubleNear(1.2, 1e-12), ::testing::DoubleNear(1.4, 1e-12),
                  ::testing::DoubleNear(1.6, 1e-12), ::testing::DoubleNear(1.8, 1e-12), 2.0));
}

// Any range: inside, no more steps than asked for, no two labels alike.
TEST(AxisTicks, OfAnyRange) {
  for (int e = -12; e <= 12; ++e) {
    for (const double offset : {0.0, -0.7, 13.0, -950.0}) {
      for (const double extent : {1.0, 1.9, 2.3, 4.9, 7.0}) {
        const double unit = std::pow(10.0, e), low = offset * unit, high = low + extent * unit;
        const AxisTicks ticks = linear_ticks(low, high, 6);
        ASSERT_GE(ticks.major.size(), 2U) << low << " to " << high;
        ASSERT_LE(ticks.major.size(), 7U) << low << " to " << high;
        for (std::size_t k = 0; k < ticks.major.size(); ++k) {
          EXPECT_GE(ticks.major[k].at, low - 1e-6 * unit);
          EXPECT_LE(ticks.major[k].at, high + 1e-6 * unit);
          if (k > 0) {
            EXPECT_NE(ticks.major[k].label, ticks.major[k - 1].label);
          }
        }
      }
    }
  }
}

TEST(AxisTicks, LogarithmicOnesArePowersOfTen) {
  const AxisTicks ticks = logarithmic_ticks(1.0, 1000.0, 8);
  EXPECT_THAT(labels(ticks), ElementsAre("10⁰", "10¹", "10²", "10³"));
  EXPECT_EQ(ticks.minor.size(), 24U);
  EXPECT_THAT(labels(logarithmic_ticks(1e-12, 10.0, 8)),
              ElementsAre("10⁻¹²", "10⁻¹⁰", "10⁻⁸", "10⁻⁶", "10⁻⁴", "10⁻²", "10⁰"));
  EXPECT_THAT(labels(logarithmic_ticks(0.15, 3.0, 8)), ElementsAre("0.2", "0.5", "1", "2"));
}

TEST(AxisTicks, NoRange) {
  EXPECT_THROW(linear_ticks(1.0, 1.0, 5), std::invalid_argument);
  EXPECT_THROW(linear_ticks(0.0, std::numeric_limits<double>::infinity(), 5),
               std::invalid_argument);
  EXPECT_THROW(linear_ticks(0.0, 1.0, 0), std::invalid_argument);
  EXPECT_THROW(logarithmic_ticks(0.0, 1.0, 5), std::invalid_argument);
}

}  // namespace
}  // namespace identikal
