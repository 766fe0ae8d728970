#include "identify/noise/likelihood_profile.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

namespace identikal {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

// An exponential sample of n with mean m: 2 (L(m) - L(x)) = 2 n (log(x / m) + m / x - 1).
TEST(LikelihoodProfile, FollowsAClosedForm) {
  const double n = 20.0, mean = 3.0;
  int turns = 0;
  const LikelihoodProfile profile =
      walk_profile(mean, mean / std::sqrt(n), 0.0, kInf, [&](double x, bool turned) {
        turns += turned;
        return std::optional<double>(2.0 * n * (std::log(x / mean) + mean / x - 1.0));
      });
  EXPECT_EQ(2, turns);
  ASSERT_EQ(profile.value.size(), profile.drop.size());
  for (std::size_t i = 0; i < profile.value.size(); ++i) {
    const double x = profile.value[i];
    EXPECT_NEAR(2.0 * n * (std::log(x / mean) + mean / x - 1.0), profile.drop[i], 1e-12);
    if (i == 0) continue;
    EXPECT_GT(x, profile.value[i - 1]);
    // Close enough to be drawn as a curve.
    const auto root = [&](std::size_t k) {
      return std::copysign(std::sqrt(profile.drop[k]), profile.value[k] - mean);
    };
    EXPECT_LT(root(i) - root(i - 1), 0.8);
  }
  EXPECT_GT(profile.drop.front(), 3.84);
  EXPECT_GT(profile.drop.back(), 3.84);
}

TEST(LikelihoodProfile, EndsAtABoundAndWhereThereIsNoAnswer) {
  const LikelihoodProfile profile =
      walk_profile(1.0, 1.0, 0.5, kInf, [](double x, bool) -> std::optional<double> {
        if (x > 2.0) return std::nullopt;
        return (x - 1.0) * (x - 1.0);
      });
  EXPECT_EQ(0.5, profile.value.front());
  EXPECT_LE(profile.value.back(), 2.0);
  EXPECT_GT(profile.value.back(), 1.0);
}

}  // namespace
}  // namespace identikal
