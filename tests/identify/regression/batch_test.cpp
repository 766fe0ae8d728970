// All samples at once: against the dense solution, several recordings, errors that are correlated.
#include "identify/regression/batch.h"

#include <cmath>
#include <string>

#include <Eigen/LU>
#include <gtest/gtest.h>

#include "identify/model/model_file.h"
#include "lib/base/error.h"
#include "lib/base/random.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

Model lagged_model(int inputs, int feedback) {
  return parse_model_file(
      "identikal: 1\nmodel: regression\ntime: {step: 0.1 s}\n"
      "inputs: {steer: {column: steer, unit: deg}}\n"
      "outputs: {v: {column: v, unit: km/h}}\n"
      "regression: {inputs: " +
          std::to_string(inputs) + ", feedback: " + std::to_string(feedback) + "}\n",
      "lagged.yaml");
}

// v = 2 steer(t) - steer(t-1) + error, in deg and km/h; an error that is `memory` of the one before.
Dataset lagged_record(std::uint64_t seed, Index N, double memory) {
  Random random(seed);
  Dataset data;
  data.name = "made.csv";
  data.dt = 0.1;
  data.time = VectorXd::LinSpaced(N, 0.0, 0.1 * static_cast<double>(N - 1));
  data.inputs = {{"steer", "deg"}};
  data.outputs = {{"v", "km/h"}};
  data.u.resize(1, N);
  data.y.resize(1, N);
  double steer = 0.0, error = 0.0, before = 0.0;
  for (Index t = 0; t < N; ++t) {
    before = steer;
    steer = 0.9 * steer + random.normal();
    error = memory * error + 0.3 * random.normal();
    data.u(0, t) = steer * M_PI / 180.0;
    data.y(0, t) = (2.0 * steer - before + error) / 3.6;
  }
  return data;
}

TEST(BatchRegression, IsTheDenseSolution) {
  const std::vector<Dataset> two{lagged_record(1, 200, 0.0), lagged_record(2, 150, 0.0)};
  const RegressionEstimate fit = fit_regression(lagged_model(2, 0), two);
  MatrixXd X(348, 2);
  VectorXd y(348);
  Index row = 0;
  for (const Dataset& data : two) {
    for (Index t = 1; t < data.size(); ++t, ++row) {
      X.row(row) << data.u(0, t) * 180.0 / M_PI, data.u(0, t - 1) * 180.0 / M_PI;
      y[row] = 3.6 * data.y(0, t);
    }
  }
  ASSERT_EQ(row, 348);
  const MatrixXd inverse = (X.transpose() * X).inverse();
  const VectorXd theta = inverse * X.transpose() * y;
  const double variance = (y - X * theta).squaredNorm() / 346.0;
  ASSERT_EQ(fit.parameters.size(), 2U);
  EXPECT_EQ(fit.parameters[1].name, "steer(t-1)");
  EXPECT_EQ(fit.parameters[1].unit, "(km/h)/deg");
  for (Index i = 0; i < 2; ++i) {
    const EstimatedParameter& p = fit.parameters[static_cast<std::size_t>(i)];
    EXPECT_NEAR(p.value, theta[i], 1e-10);
    EXPECT_NEAR(p.se, std::sqrt(variance * inverse(i, i)), 1e-10);
  }
  EXPECT_EQ(fit.status, Status::ok);
  EXPECT_EQ(fit.inputs.size(), 2U);
}

TEST(BatchRegression, ErrorsThatAreCorrelatedCount) {
  const double alone =
      fit_regression(lagged_model(2, 0), {lagged_record(3, 3000, 0.0)}).parameters[0].se;
  const RegressionEstimate coloured =
      fit_regression(lagged_model(2, 0), {lagged_record(3, 3000, 0.9)});
  EXPECT_GT(coloured.parameters[0].se, 2.0 * alone);
  EXPECT_NEAR(coloured.parameters[0].value, 2.0, 4.0 * coloured.parameters[0].se);
  EXPECT_EQ(coloured.status, Status::ok);
  // With the output before among the regressors coefficients are biased, and not ok.
  const RegressionEstimate biased =
      fit_regression(lagged_model(1, 1), {lagged_record(3, 3000, 0.9)});
  EXPECT_NE(biased.status, Status::ok);
}

TEST(BatchRegression, SaysWhatIsOpen) {
  Dataset straight = lagged_record(4, 100, 0.0);
  straight.u.setConstant(0.1);
  const RegressionEstimate open = fit_regression(lagged_model(2, 0), {straight});
  EXPECT_EQ(open.status, Status::rejected);
  EXPECT_THROW(fit_regression(lagged_model(5, 5), {lagged_record(5, 8, 0.0)}), InputError);
}

}  // namespace
}  // namespace identikal
