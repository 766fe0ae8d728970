#include "lib/statistics/sequential_probability_ratio.h"

#include <cmath>
#include <stdexcept>

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <gtest/gtest.h>

#include "lib/base/constants.h"
#include "lib/base/random.h"
#include "tests/support/random_model.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

SequentialDecision run(SequentialProbabilityRatio& test, const MatrixXd& e) {
  for (Index t = 0; t < e.cols(); ++t) {
    if (update(test, e.col(t)) != SequentialDecision::undecided) break;
  }
  return test.decision;
}

// Options under which nothing is ever decided, to look at the two logarithms.
SequentialProbabilityRatioOptions never(std::vector<Index> orders) {
  SequentialProbabilityRatioOptions out;
  out.orders = std::move(orders);
  out.false_alarm = out.miss = 1e-300;
  return out;
}

// log of the marginal density of y = X beta + noise under beta ~ N(0, noise * diag(prior)) and a
// scale of which `squares` with `dof` degrees of freedom are known, up to what does not depend on
// X.
double log_marginal(const VectorXd& y, const MatrixXd& X, const VectorXd& prior, double squares,
                    double dof) {
  const MatrixXd V =
      MatrixXd::Identity(y.size(), y.size()) + X * prior.asDiagonal() * X.transpose();
  const Eigen::LLT<MatrixXd> llt(V);
  const double n = dof + static_cast<double>(y.size());
  return -llt.matrixLLT().diagonal().array().log().sum() -
         0.5 * n * std::log(squares + y.dot(llt.solve(y)));
}

// The ratio as one integral over coefficients and scale, all samples at once.
TEST(SequentialProbabilityRatio, AgreesWithTheMarginalLikelihoodsOfAllSamplesTogether) {
  Random random(1);
  for (const Index ny : {1, 2, 3}) {
    const Index N = 60, order = 2, first = 5 * (ny + 1);
    const MatrixXd e = random_matrix(random, ny, ny) * random_matrix(random, ny, N);
    SequentialProbabilityRatio test = start_sequential_probability_ratio(ny, never({order}));
    run(test, e);
    const MatrixXd S =
        e.leftCols(first) * e.leftCols(first).transpose() / static_cast<double>(first);
    const MatrixXd x = S.llt().matrixL().solve(e);
    double expected = 0.0;
    for (Index i = 0; i < ny; ++i) {
      const Index n = N - first, lagged = ny * order;
      MatrixXd X(n, lagged + i);
      for (Index t = 0; t < n; ++t) {
        X.row(t) << x.col(first + t - 2).transpose(), x.col(first + t - 1).transpose(),
            x.col(first + t).head(i).transpose();
      }
      VectorXd prior(lagged + i);
      prior << VectorXd::Constant(lagged, 0.1 / static_cast<double>(lagged)),
          VectorXd::Constant(i, 1.0 / static_cast<double>(first));
      const VectorXd y = x.row(i).tail(n).transpose();
      const auto known = static_cast<double>(first), dof = static_cast<double>(first - i);
      expected += log_marginal(y, X, prior, known, dof) -
                  log_marginal(y, X.rightCols(i), prior.tail(i), known, dof);
    }
    EXPECT_NEAR(test.log_coloured, expected, 1e-8) << ny;
  }
}

TEST(SequentialProbabilityRatio, WhiteIsALikelihoodRatioAgainstTheLikeliestColourOfTheStatedSize) {
  Random random(2);
  const VectorXd e = random.normal(300);
  SequentialProbabilityRatioOptions options = never({1, 2});
  options.smallest = 0.4;
  SequentialProbabilityRatio test = start_sequential_probability_ratio(1, options);
  run(test, e.transpose());
  const Index first = 10, n = 290;
  MatrixXd X(n, 2);
  X << e.segment(first - 1, n), e.segment(first - 2, n);
  const VectorXd y = e.tail(n), best = X.colPivHouseholderQr().solve(y);
  // The boundary theta' X'X theta = smallest^2 y'y, walked along.
  const MatrixXd root = (X.transpose() * X).llt().matrixU();
  double least = HUGE_VAL;
  for (int k = 0; k < 100000; ++k) {
    const double angle = 2e-5 * M_PI * k;
    const VectorXd theta = root.triangularView<Eigen::Upper>().solve(
        Eigen::Vector2d(0.4 * y.norm() * Eigen::Vector2d(std::cos(angle), std::sin(angle))));
    least = std::min(least, (y - X * theta).squaredNorm());
  }
  EXPECT_NEAR(test.log_white, 0.5 * 290.0 * std::log(least / y.squaredNorm()), 1e-3);
}

TEST(SequentialProbabilityRatio, UnitsAndMixturesOfChannelsThatKeepTheirOrderChangeNothing) {
  Random random(3);
  const MatrixXd e = random_matrix(random, 3, 200);
  MatrixXd T(3, 3);
  T << 1e-3, 0, 0, 2, 50, 0, -7, 1, 1e4;
  SequentialProbabilityRatio a = start_sequential_probability_ratio(3, never({1, 3})), b = a;
  run(a, e);
  run(b, T * e);
  EXPECT_NEAR(a.log_coloured, b.log_coloured, 1e-9);
  EXPECT_NEAR(a.log_white, b.log_white, 1e-9);
}

TEST(SequentialProbabilityRatio, MissingSamplesAreLeftOutWithTheirHistory) {
  Random random(4);
  const VectorXd e = random.normal(200);
  SequentialProbabilityRatio gaps = start_sequential_probability_ratio(1, never({1})), plain = gaps;
  for (Index t = 0; t < 200; ++t) {
    update(gaps, e.segment(t, 1));
    if (t == 100) update(gaps, VectorXd::Constant(1, kNaN));
    update(plain, e.segment(t, 1));
  }
  EXPECT_EQ(gaps.samples, 200);
  // The one sample behind the gap is not predicted; all else is as before.
  EXPECT_NE(gaps.log_coloured, plain.log_coloured);
  EXPECT_NEAR(gaps.log_coloured, plain.log_coloured, 0.5);
  EXPECT_EQ(gaps.white_samples, plain.white_samples - 1);
}

TEST(SequentialProbabilityRatio, NothingIsDecidedFromNothing) {
  for (const double value : {0.0, kNaN, HUGE_VAL}) {
    SequentialProbabilityRatio test = start_sequential_probability_ratio(2, {});
    EXPECT_EQ(run(test, MatrixXd::Constant(2, 3000, value)), SequentialDecision::undecided);
    EXPECT_EQ(test.log_coloured, 0.0);
    EXPECT_EQ(test.log_white, 0.0);
  }
  Random random(5);
  MatrixXd one_channel = random_matrix(random, 2, 3000);
  one_channel.row(1) = 2.0 * one_channel.row(0);
  SequentialProbabilityRatio test = start_sequential_probability_ratio(2, {});
  EXPECT_EQ(run(test, one_channel), SequentialDecision::undecided);
}

TEST(SequentialProbabilityRatio, DecidesAndBeginsAgain) {
  Random random(6);
  SequentialProbabilityRatio test = start_sequential_probability_ratio(1, {});
  EXPECT_EQ(run(test, random_matrix(random, 1, 3000)), SequentialDecision::white);
  const Index samples = test.samples;
  EXPECT_GT(samples, 100);
  double x = 0.0;
  SequentialDecision decision = SequentialDecision::undecided;
  for (int t = 0; t < 3000 && decision == SequentialDecision::undecided; ++t) {
    x = 0.5 * x + random.normal();
    decision = update(test, VectorXd::Constant(1, x));
  }
  EXPECT_EQ(decision, SequentialDecision::coloured);
  EXPECT_LT(test.samples, 300);
  restart(test);
  EXPECT_EQ(test.samples, 0);
}

TEST(SequentialProbabilityRatio, OptionsOutOfRangeAreRefused) {
  SequentialProbabilityRatioOptions bad;
  bad.orders = {};
  EXPECT_THROW(start_sequential_probability_ratio(1, bad), std::invalid_argument);
  bad.orders = {0};
  EXPECT_THROW(start_sequential_probability_ratio(1, bad), std::invalid_argument);
  bad = {};
  bad.false_alarm = 0.0;
  EXPECT_THROW(start_sequential_probability_ratio(1, bad), std::invalid_argument);
  bad = {};
  bad.forgetting = 1.5;
  EXPECT_THROW(start_sequential_probability_ratio(1, bad), std::invalid_argument);
  EXPECT_THROW(start_sequential_probability_ratio(0, {}), std::invalid_argument);
  SequentialProbabilityRatio test = start_sequential_probability_ratio(2, {});
  EXPECT_THROW(update(test, VectorXd::Zero(1)), std::invalid_argument);
}

// a = 0.05, 500 seeds of 1000 white samples: at most 5 %, 3 standard errors are 2.9 %. All rates
// with more seeds: sequential_probability_ratio_study.cpp.
TEST(SequentialProbabilityRatio, FalseAlarmsKeepTheirBound) {
  for (const double forgetting : {1.0, 0.99}) {
    int alarms = 0, whites = 0;
    SequentialProbabilityRatioOptions options;
    options.forgetting = forgetting;
    SequentialProbabilityRatio test = start_sequential_probability_ratio(1, options);
    for (std::uint64_t seed = 1; seed <= 500; ++seed) {
      Random random(seed);
      restart(test);
      const SequentialDecision decision = run(test, random_matrix(random, 1, 1000));
      alarms += decision == SequentialDecision::coloured;
      whites += decision == SequentialDecision::white;
    }
    std::printf("white noise, forgetting %.2f: coloured %.1f %%, white %.1f %%\n", forgetting,
                alarms / 5.0, whites / 5.0);
    EXPECT_LE(alarms, 500 * (0.05 + 0.029));
    EXPECT_GE(whites, 400);
  }
}

}  // namespace
}  // namespace identikal
