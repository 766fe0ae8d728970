// Is the likelihood of any model file that of the joint Gaussian density of its samples?
#include <algorithm>
#include <cmath>
#include <cstdio>

#include <gtest/gtest.h>

#include "tests/campaigns/random_model_file.h"

namespace identikal {

TEST(RandomModels, HaveTheLikelihoodOfTheirJointDensity) {
  double worst = 0.0;
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    const RandomModelFile drawn = draw_model_file(seed);
    const double found = log_likelihood_of(drawn), expected = drawn.log_likelihood;
    const double off = std::abs(found - expected) / std::max(1.0, std::abs(expected));
    worst = std::max(worst, off);
    EXPECT_LT(off, 1e-8) << drawn.words << ": " << found << " instead of " << expected << "\n"
                         << drawn.yaml;
  }
  std::printf("200 model files: log-likelihoods at most %.1e off\n", worst);
}

}  // namespace identikal
