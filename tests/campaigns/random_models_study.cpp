// Twenty thousand model files against the joint Gaussian density of their samples.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>

#include <gtest/gtest.h>

#include "tests/campaigns/random_model_file.h"

namespace identikal {

TEST(RandomModelsStudy, TwentyThousand) {
  double worst = 0.0;
  int undetermined = 0;
  for (std::uint64_t seed = 1; seed <= 20'000; ++seed) {
    const RandomModelFile drawn = draw_model_file(seed);
    const double found = log_likelihood_of(drawn), expected = drawn.log_likelihood;
    // A diffuse start that a dozen samples hardly determine is refused, not computed badly.
    if (std::isnan(found) && drawn.words.find("diffuse") != std::string::npos) {
      ++undetermined;
      continue;
    }
    const double off = std::abs(found - expected) / std::max(1.0, std::abs(expected));
    worst = std::max(worst, off);
    EXPECT_LT(off, 1e-8) << drawn.words << ": " << found << " instead of " << expected << "\n"
                         << drawn.yaml;
  }
  std::printf("20000 model files: log-likelihoods at most %.1e off, %d starts refused\n", worst,
              undetermined);
  EXPECT_LE(undetermined, 20);
}

}  // namespace identikal
