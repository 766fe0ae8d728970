// Probabilities at the ends of what a statistic can be, where series and gamma functions overflow.
#include "identify/estimate/distribution.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

namespace identikal {
namespace {

TEST(Distribution, TailsOfNothingAndOfEverything) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  for (const double dof : {1.0, 100.0, 101.0, 345.0, 2000.0, 1e6}) {
    EXPECT_EQ(chi_square_upper_tail(kInfinity, dof), 0.0);
    for (const double value : {1e-300, 1e-20, 1e-10})
      EXPECT_NEAR(chi_square_upper_tail(value, dof), 1.0, 1e-4) << value << " of " << dof;
    EXPECT_NEAR(chi_square_upper_tail(dof, dof), 0.5, 0.2);
    EXPECT_EQ(f_upper_tail(kInfinity, dof, 10.0), 0.0);
    EXPECT_NEAR(f_upper_tail(1e-300, dof, 10.0), 1.0, 1e-12);
  }
  // P(chi-square with 102 degrees of freedom above 0.102), by both sides of where the series is left out.
  EXPECT_EQ(chi_square_upper_tail(0.1019, 102.0), chi_square_upper_tail(0.1021, 102.0));
}

}  // namespace
}  // namespace identikal
