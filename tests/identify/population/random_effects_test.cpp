#include "identify/population/random_effects.h"

#include <cmath>
#include <cstdio>
#include <random>
#include <stdexcept>

#include <gtest/gtest.h>

#include "identify/estimate/distribution.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

VectorXd vector(std::initializer_list<double> values) {
  return Eigen::Map<const VectorXd>(values.begin(), static_cast<Index>(values.size()));
}

// metafor 3.8-1 of R 4.2.2: rma(y, v, method = "REML", test = "knha"), confint() for tau by the Q
// profile, blup().
const VectorXd kY = vector({2.31, 1.87, 2.95, 2.40, 1.62, 2.12, 2.77, 1.98, 2.25, 3.60});
const VectorXd kV = vector({.04, .09, .06, .02, .12, .05, .03, .08, .04, .07});

TEST(RandomEffects, AreThoseOfMetafor) {
  const RandomEffects all = random_effects(kY, kV, MatrixXd::Ones(10, 1));
  EXPECT_NEAR(all.beta[0], 2.40479954882158, 1e-9);
  EXPECT_NEAR(all.se[0], 0.178442444834412, 1e-9);
  EXPECT_NEAR(all.interval[0][0], 2.00113469409219, 1e-9);
  EXPECT_NEAR(all.interval[0][1], 2.80846440355097, 1e-9);
  EXPECT_NEAR(all.sd * all.sd, 0.243125408174368, 1e-9);
  EXPECT_NEAR(all.q, 42.4965559429865, 1e-9);
  EXPECT_NEAR(all.q_p_value, 2.66612316736657e-06, 1e-13);
  EXPECT_NEAR(all.log_likelihood, -7.65003302778009, 1e-9);
  EXPECT_NEAR(all.sd_interval[0], 0.2913370320856076, 1e-9);
  EXPECT_NEAR(all.sd_interval[1], 1.02590501904817, 1e-9);
  const VectorXd blup = vector(
      {2.32339329443201, 2.01448600500851, 2.84208417972047, 2.40036481074594, 1.87934826850058,
       2.16857981274898, 2.72988650924649, 2.08517267613752, 2.27187010340326, 3.33280982827206});
  EXPECT_LT((all.shrunken - blup).cwiseAbs().maxCoeff(), 1e-9);
}

TEST(RandomEffects, WithACovariateAreThoseOfMetafor) {
  MatrixXd X(10, 2);
  X << VectorXd::Ones(10), VectorXd::LinSpaced(10, 1.0, 10.0);
  const RandomEffects all = random_effects(kY, kV, X);
  EXPECT_NEAR(all.beta[0], 2.059381496013160, 1e-8);
  EXPECT_NEAR(all.beta[1], 0.062802740056913, 1e-9);
  EXPECT_NEAR(all.se[0], 0.384980412440166, 1e-8);
  EXPECT_NEAR(all.se[1], 0.062060915606253, 1e-9);
  EXPECT_NEAR(all.p_value[1], 0.341184735164267, 1e-8);
  EXPECT_NEAR(all.sd * all.sd, 0.24529461874836625, 1e-8);
  EXPECT_NEAR(all.sd_interval[0], 0.283225376578081, 1e-8);
  EXPECT_NEAR(all.sd_interval[1], 1.07514167349934, 1e-8);
}

// Twelve units, five measurements each: lme(z ~ 1, random = ~1 | u) of nlme 3.1-162 and lmer() of lme4
// 1.1-31 give 2.8223167 +- 0.2282190, between units 0.7655908, within 0.4408948. Here in two stages:
// each unit's mean, whose variance is the pooled one.
TEST(RandomEffects, OfALinearCaseAreThoseOfNlmeAndLme4) {
  const std::vector<double> z = {
      1.872, 2.357, 2.306, 2.077, 1.754, 2.442, 3.378, 2.866, 2.477, 2.295, 3.105, 2.374,
      2.965, 2.836, 3.787, 2.584, 2.042, 1.51,  2.529, 2.504, 3.52,  3.525, 2.981, 3.509,
      3.807, 3.043, 2.534, 3.421, 3.417, 2.869, 3.918, 2.671, 3.243, 1.936, 2.987, 4.459,
      3.666, 3.444, 4.257, 3.489, 2.158, 1.156, 1.319, 1.798, 1.507, 4.695, 4.473, 3.621,
      4.301, 4.473, 2.532, 2.58,  2.991, 2.164, 2.195, 2.573, 1.451, 2.188, 2.079, 2.329};
  const Eigen::Map<const MatrixXd> by_unit(z.data(), 5, 12);
  const VectorXd means = by_unit.colwise().mean();
  const double pooled =
      (by_unit.rowwise() - means.transpose()).squaredNorm() / static_cast<double>(60 - 12);
  EXPECT_NEAR(std::sqrt(pooled), 0.440894819, 1e-8);
  const RandomEffects all =
      random_effects(means, VectorXd::Constant(12, pooled / 5.0), MatrixXd::Ones(12, 1));
  EXPECT_NEAR(all.beta[0], 2.8223166667, 1e-9);
  EXPECT_NEAR(all.se[0], 0.2282189850, 1e-8);
  EXPECT_NEAR(all.sd, 0.7655907609, 1e-8);
}

// Y, v and X in other units: the same answer in those units.
TEST(RandomEffects, UnitsDoNotMatter) {
  const RandomEffects one = random_effects(kY, kV, MatrixXd::Ones(10, 1));
  const RandomEffects other =
      random_effects(1e-6 * kY, 1e-12 * kV, MatrixXd::Constant(10, 1, 1e-6));
  EXPECT_NEAR(other.beta[0], one.beta[0], 1e-9);
  EXPECT_NEAR(1e6 * other.sd, one.sd, 1e-9);
  EXPECT_EQ(other.belongs, one.belongs);
  EXPECT_LT((other.distance - one.distance).cwiseAbs().maxCoeff(), 1e-8);
}

TEST(RandomEffects, EqualUnitsHaveNoSpread) {
  const RandomEffects all =
      random_effects(VectorXd::Constant(6, 2.0), VectorXd::Constant(6, 0.1), MatrixXd::Ones(6, 1));
  EXPECT_EQ(all.sd, 0.0);
  EXPECT_EQ(all.sd_interval[0], 0.0);
  EXPECT_EQ(all.sd_interval[1], 0.0);
}

TEST(RandomEffects, WhatCannotBeAnalysedIsRefused) {
  const MatrixXd one = MatrixXd::Ones(10, 1);
  EXPECT_THROW(random_effects(kY.head(2), kV.head(2), one.topRows(2)), std::invalid_argument);
  EXPECT_THROW(random_effects(kY, kV.head(9), one), std::invalid_argument);
  EXPECT_THROW(random_effects(kY, VectorXd::Zero(10), one), std::invalid_argument);
  EXPECT_THROW(random_effects(kY, kV, MatrixXd::Ones(10, 2)), std::invalid_argument);
  VectorXd nan = kY;
  nan[3] = std::nan("");
  EXPECT_THROW(random_effects(nan, kV, one), std::invalid_argument);
}

// A fleet of 50 units: estimates with errors of different size about a spread.
struct Fleet {
  VectorXd y, v;
};

Fleet simulated(std::mt19937_64& random, double sd, int strangers) {
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform(0.2, 1.0);
  Fleet out{VectorXd(50), VectorXd(50)};
  for (Index i = 0; i < 50; ++i) {
    const double error = uniform(random);
    out.v[i] = error * error;
    out.y[i] = 10.0 + sd * normal(random) + error * normal(random);
    if (i < strangers) out.y[i] += (i % 2 == 0 ? 8.0 : -8.0);
  }
  return out;
}

// Of `trials`, a count so far from what is expected as happens once in a hundred.
void expect_share(int count, int trials, double expected, const char* what) {
  const double z = (count - expected * trials) / std::sqrt(trials * expected * (1.0 - expected));
  std::printf("%s: %d of %d, expected %.0f, p %.2g\n", what, count, trials, expected * trials,
              normal_two_sided(z));
  EXPECT_GT(normal_two_sided(z), 0.005) << what;  // two shares: 1 % together
}

// 2000 fleets of 50 units: coverage of mean and of spread; the test rejects right ones in 1 %.
TEST(RandomEffects, IntervalsOf2000FleetsCover) {
  std::mt19937_64 random(7);
  int mean = 0, sd = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    const Fleet fleet = simulated(random, 0.7, 0);
    const RandomEffects all = random_effects(fleet.y, fleet.v, MatrixXd::Ones(50, 1));
    mean += all.interval[0][0] <= 10.0 && 10.0 <= all.interval[0][1] ? 1 : 0;
    sd += all.sd_interval[0] <= 0.7 && 0.7 <= all.sd_interval[1] ? 1 : 0;
  }
  expect_share(mean, 2000, 0.95, "mean within its 95 % interval");
  expect_share(sd, 2000, 0.95, "sd within its 95 % interval");
}

// False discoveries among those that are said not to belong: none of 200 fleets has any stranger, so
// every discovery is false, and 5 % of fleets may have one; with four strangers their share is 5 % at
// most.
TEST(RandomEffects, FalseDiscoveriesAreAsStated) {
  std::mt19937_64 random(8);
  int fleets = 0;
  for (int trial = 0; trial < 200; ++trial) {
    const Fleet fleet = simulated(random, 0.7, 0);
    const RandomEffects all = random_effects(fleet.y, fleet.v, MatrixXd::Ones(50, 1));
    fleets += std::count(all.belongs.begin(), all.belongs.end(), false) > 0 ? 1 : 0;
  }
  std::printf("fleets without strangers in which one is found: %d of 200, allowed 10\n", fleets);
  EXPECT_LE(fleets, 18);  // more happen once in a hundred where 5 % is right
  double share = 0.0;
  int found = 0;
  for (int trial = 0; trial < 200; ++trial) {
    const Fleet fleet = simulated(random, 0.7, 4);
    const RandomEffects all = random_effects(fleet.y, fleet.v, MatrixXd::Ones(50, 1));
    int right = 0, wrong = 0;
    for (std::size_t i = 0; i < 50; ++i) {
      if (!all.belongs[i]) ++(i < 4 ? right : wrong);
    }
    found += right;
    share += right + wrong > 0 ? static_cast<double>(wrong) / (right + wrong) : 0.0;
  }
  std::printf("strangers found: %d of 800; false discoveries %.1f %%, stated 5 %%\n", found,
              share / 2.0);
  EXPECT_LE(share / 200.0, 0.05);
  EXPECT_GE(found, 600);
}

TEST(CombineUnits, AllowsForWhatRecordingsDifferBy) {
  std::mt19937_64 random(9);
  std::normal_distribution<double> normal;
  VectorXd y(200), v = VectorXd::Constant(200, 0.04);
  std::vector<int> unit;
  for (Index i = 0; i < 200; ++i) {
    unit.push_back(static_cast<int>(i / 4));
    y[i] = static_cast<double>(i / 4) + 0.5 * normal(random) + 0.2 * normal(random);
  }
  const CombinedUnits all = combine_units(y, v, unit, 50);
  EXPECT_NEAR(all.within_sd, 0.5, 0.06);
  EXPECT_NEAR(all.v[7], (0.04 + all.within_sd * all.within_sd) / 4.0, 1e-12);
  EXPECT_NEAR(all.y[7], y.segment(28, 4).mean(), 1e-12);
  const CombinedUnits single = combine_units(y.head(3), v.head(3), {0, 1, 2}, 3);
  EXPECT_EQ(single.within_sd, 0.0);
  EXPECT_NEAR(single.y[2], y[2], 1e-15);
}

}  // namespace
}  // namespace identikal
