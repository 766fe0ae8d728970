// Error rates and decision times of the sequential whiteness test, 2000 seeds each.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <vector>

#include <gtest/gtest.h>

#include "lib/base/random.h"
#include "lib/statistics/sequential_probability_ratio.h"
#include "tests/support/matisko_example_1.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

constexpr int kSeeds = 2000;

struct Rates {
  double white = 0.0, coloured = 0.0;
  Index median = 0;  // samples until the decision
};

Rates rates(const char* what, Index ny, Index N, const SequentialProbabilityRatioOptions& options,
            const std::function<MatrixXd(Random&)>& innovations) {
  SequentialProbabilityRatio test = start_sequential_probability_ratio(ny, options);
  Rates out;
  std::vector<Index> samples;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    Random random(seed);
    restart(test);
    const MatrixXd e = innovations(random);
    for (Index t = 0; t < N && test.decision == SequentialDecision::undecided; ++t) {
      update(test, e.col(t));
    }
    out.white += test.decision == SequentialDecision::white;
    out.coloured += test.decision == SequentialDecision::coloured;
    if (test.decision != SequentialDecision::undecided) samples.push_back(test.samples);
  }
  out.white /= kSeeds;
  out.coloured /= kSeeds;
  if (!samples.empty()) {
    std::nth_element(samples.begin(), samples.begin() + samples.size() / 2, samples.end());
    out.median = samples[samples.size() / 2];
  }
  std::printf("%-42s N %5ld: white %5.1f %%  coloured %5.1f %%  undecided %5.1f %%  median %ld\n",
              what, static_cast<long>(N), 100 * out.white, 100 * out.coloured,
              100 * (1 - out.white - out.coloured), static_cast<long>(out.median));
  return out;
}

MatrixXd white_noise(Random& random, Index ny, Index N) {
  MatrixXd e(ny, N);
  for (Index t = 0; t < N; ++t) e.col(t) = random.normal(ny);
  return e;
}

// A bound p is kept when the rate is below p plus three standard errors.
double with_chance(double p) { return p + 3.0 * std::sqrt(p * (1.0 - p) / kSeeds); }

TEST(SequentialTestStudy, FalseAlarmsStayBelowTheirBound) {
  for (const double a : {0.05, 0.01}) {
    for (const Index ny : {1, 3}) {
      for (const double forgetting : {1.0, 0.98}) {
        SequentialProbabilityRatioOptions options;
        options.false_alarm = a;
        options.forgetting = forgetting;
        options.miss = 1e-300;  // never stops at white: the bound holds for all time
        char what[80];
        std::snprintf(what, sizeof what, "white, %ld outputs, a %.2f, forgetting %.2f",
                      static_cast<long>(ny), a, forgetting);
        const Rates r = rates(what, ny, 2000, options,
                              [&](Random& random) { return white_noise(random, ny, 2000); });
        EXPECT_LE(r.coloured, with_chance(a)) << what;
      }
    }
  }
}

// Sequences of just the stated size, of several shapes.
TEST(SequentialTestStudy, MissesStayBelowTheirBound) {
  for (const double b : {0.05, 0.01}) {
    SequentialProbabilityRatioOptions options;
    options.miss = b;
    options.false_alarm = 1e-300;
    for (const Index lag : {1, 2, 5}) {
      char what[80];
      std::snprintf(what, sizeof what, "AR at lag %ld of the stated size, b %.2f",
                    static_cast<long>(lag), b);
      const Rates r = rates(what, 1, 2000, options, [&](Random& random) {
        const double theta = options.smallest;
        MatrixXd e = white_noise(random, 1, 2000);
        for (Index t = 0; t < 2000; ++t) {
          e(0, t) =
              t < lag ? e(0, t) / std::sqrt(1 - theta * theta) : theta * e(0, t - lag) + e(0, t);
        }
        return e;
      });
      EXPECT_LE(r.white, with_chance(b)) << what;
    }
    char what[80];
    std::snprintf(what, sizeof what, "3 outputs, one coupled to the past, b %.2f", b);
    const Rates r = rates(what, 3, 2000, options, [&](Random& random) {
      MatrixXd e = white_noise(random, 3, 2000);
      const double theta = options.smallest;
      for (Index t = 1999; t > 0; --t) {
        e(2, t) = std::sqrt(1 - theta * theta) * e(2, t) + theta * e(0, t - 1);
      }
      return e;
    });
    EXPECT_LE(r.white, with_chance(b)) << what;
  }
}

// Table 1 of the source, column Test.4: a = 0.05, b = 0.01, N the most samples there are.
TEST(SequentialTestStudy, Table1) {
  const char* tunings[] = {"optimal", "Q = 4 I", "Q = Q_1, R = 2"};
  const char* published[3][3] = {
      {"39;1", "97;0", "100;0"}, {"8;27", "47;33", "51;44"}, {"94;5", "98;2", "95;5"}};
  for (int tuning = 0; tuning < 3; ++tuning) {
    for (int n = 0; n < 3; ++n) {
      const Index N = Index{200} + (n == 0 ? 0 : n == 1 ? 300 : 800);
      std::printf("published, %% right;wrong: %-8s ", published[tuning][n]);
      const Rates r = rates(tunings[tuning], 1, N, {}, [&](Random& random) {
        return matisko_example_1_innovations(tuning, N, random);
      });
      if (tuning == 0) {
        EXPECT_LE(r.coloured, with_chance(0.05));
      }
    }
  }
}

}  // namespace
}  // namespace identikal
