#include "identify/filter/leading_samples.h"

#include <cmath>

#include <gtest/gtest.h>

#include "identify/model/builder.h"
#include "identify/model/recording.h"
#include "identify/noise/ml.h"
#include "lib/base/random.h"
#include "lib/filter/kalman.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

// A trend whose slope is written in another unit.
Model trend(double unit) {
  return linear_model()
      .A(MatrixXd{{1.0, unit}, {0.0, 1.0}})
      .C({{1, 0}})
      .G(MatrixXd{{1.0, 0.0}, {0.0, 1.0 / unit}})
      .process_noise(variances({{"q", 1.0}, {"slope", 0.01}}))
      .measurement_noise(variance("r", 4.0))
      .diffuse();
}

MatrixXd walk(Index N) {
  Random random(2);
  MatrixXd y(1, N);
  double level = 0.0;
  for (Index t = 0; t < N; ++t) {
    level += random.normal();
    y(0, t) = level + 2.0 * random.normal();
  }
  return y;
}

// Against the log-likelihoods of recordings that end after k samples.
TEST(LeadingSamples, AreTheLogLikelihoodsOfShorterRecordings) {
  MatrixXd y = walk(60);
  y(0, 1) = y(0, 7) = std::nan("");
  const Model model = trend(1.0);
  const std::vector<Dataset> data{recording(model, y, 1.0),
                                  recording(model, MatrixXd(y.rightCols(40)), 1.0)};
  const LeadingSamples leading = leading_samples(model, model.parameters, data);
  EXPECT_EQ(leading.diffuse, 3);
  const StateSpace system = instantiate(as_linear(model), model.parameters);
  for (Index k = 1; k <= leading.log_likelihood.size(); ++k) {
    double sum = 0.0;
    bool determined = true;
    for (const Dataset& each : data) {
      const Likelihood l =
          log_likelihood(system, InitialState::diffuse, each.y.leftCols(k), MatrixXd(0, k));
      determined = determined && l.status == FilterStatus::ok;
      sum += l.value;
    }
    if (determined) {
      EXPECT_NEAR(leading.log_likelihood[k - 1], sum, 1e-9 * std::abs(sum)) << k;
    } else {
      EXPECT_TRUE(std::isnan(leading.log_likelihood[k - 1])) << k;
    }
  }
}

// What stands behind them, AIC and BIC do not know in what a state is measured.
TEST(LeadingSamples, TheUnitOfAStateDoesNotMatterBehindThem) {
  const MatrixXd y = walk(200);
  NoiseMlOptions options;
  options.starts = 1;
  options.profiles = false;
  const Model metres = trend(1.0), thousands = trend(1000.0);
  const NoiseEstimate a = tune_ml(metres, {recording(metres, y, 1.0)}, options);
  const NoiseEstimate b = tune_ml(thousands, {recording(thousands, y, 1.0)}, options);
  EXPECT_GT(std::abs(a.objective.log_likelihood - b.objective.log_likelihood), 5.0);
  for (const Index k : {2, 3, 10}) {
    EXPECT_NEAR(log_likelihood_behind(a.objective, k), log_likelihood_behind(b.objective, k), 1e-6);
  }
  EXPECT_NEAR(a.objective.aic, b.objective.aic, 1e-5);
  EXPECT_NEAR(a.objective.bic, b.objective.bic, 1e-5);
}

}  // namespace
}  // namespace identikal
