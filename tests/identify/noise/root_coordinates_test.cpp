#include "identify/noise/internal/root_coordinates.h"

#include <cmath>
#include <string>

#include <gtest/gtest.h>

#include "identify/filter/recordings_likelihood.h"
#include "identify/model/model_file.h"
#include "identify/noise/ml.h"
#include "lib/base/random.h"
#include "lib/model/polynomial_factors.h"

namespace identikal {
namespace {

Model parsed(const std::string& text) {
  return parse_model_file("identikal: 1\ntime: {kind: discrete, step: 1 s}\n" + text, "model.yaml");
}

std::vector<PolynomialFactor> factors_of(const std::string& text) {
  const Model model = parsed(text);
  return polynomial_factors(noise_model(model), model.parameters);
}

const char kSeasonal[] = R"(
parameters:
  a1: {value: 0.5}
  a2: {value: 0}
  A1: {value: 0}
  m1: {value: 0}
  q: {value: 1, min: 0}
A: [[a1, a2 + A1, -(a1)*(A1), -(a2)*(A1)], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]]
G: [[1], [0], [0], [0]]
C: [[1, -m1, 0, 0]]
Q: [[q]]
R: [[0]]
initial: stationary
outputs: [{name: y, column: y}]
)";

// (1 - a1 z - a2 z^2)(1 - A1 z^2): a2 and A1 stand at the same power.
TEST(PolynomialFactors, ASeasonBesideThePowersOfOneStep) {
  const auto found = factors_of(kSeasonal);
  ASSERT_EQ(found.size(), 3U);
  EXPECT_EQ(found[0].parameters, (std::vector<int>{0, 1}));
  EXPECT_EQ(found[0].lag, 1);
  EXPECT_EQ(found[1].parameters, std::vector<int>{2});
  EXPECT_EQ(found[1].lag, 2);
  EXPECT_FALSE(found[1].moving_average);
  EXPECT_TRUE(found[2].moving_average);
  EXPECT_EQ(found[2].parameters, std::vector<int>{3});
  EXPECT_EQ(found[2].sign[0], 1.0) << "1 - m1 z";
}

// An autoregression with a moving average in Harvey's form, measured together with another one.
std::string sum_of_two(const std::string& variance, const std::string& initial) {
  return "parameters: {a: {value: 0.5}, b: {value: 0.2}, m: {value: 0.1}, q: {value: 1, min: 0}}\n"
         "A: [[b, 0, 0], [0, a, 1], [0, 0, 0]]\n"
         "G: [[1, 0], [0, 1], [0, m]]\n"
         "C: [[1, 1, 0]]\n"
         "Q: [[q, 0], [0, " +
         variance + "]]\nR: [[1]]\ninitial: " + initial + "\noutputs: [{name: y, column: y}]\n";
}

TEST(PolynomialFactors, GroupsOfStatesCountByThemselves) {
  const auto found = factors_of(sum_of_two("q", "stationary"));
  ASSERT_EQ(found.size(), 3U);
  EXPECT_EQ(found[0].parameters, std::vector<int>{1});
  EXPECT_EQ(found[1].parameters, std::vector<int>{0});
  EXPECT_EQ(found[2].parameters, std::vector<int>{2});
  EXPECT_EQ(found[2].sign[0], -1.0) << "1 + m z";
  EXPECT_EQ(found[1].group, found[2].group);
  EXPECT_NE(found[0].group, found[1].group);
}

// With a known variance the image of a root in the unit circle is another model.
TEST(PolynomialFactors, NoMovingAverageWhereItsVarianceIsKnown) {
  const auto found = factors_of(sum_of_two("1", "stationary"));
  ASSERT_EQ(found.size(), 2U);
  for (const PolynomialFactor& factor : found) EXPECT_FALSE(factor.moving_average);
}

TEST(PolynomialFactors, OfStatesThatStartStationaryAlone) {
  EXPECT_TRUE(factors_of(sum_of_two("q", "diffuse")).empty());
  const auto one = factors_of(sum_of_two("q", "{x1: stationary, x2: diffuse, x3: diffuse}"));
  ASSERT_EQ(one.size(), 1U);
  EXPECT_EQ(one[0].parameters, std::vector<int>{1});
  EXPECT_EQ(factors_of(sum_of_two("q", "{x1: diffuse, x2: stationary, x3: stationary}")).size(),
            2U);
}

// The same likelihood, with its slopes by partial autocorrelations, as by the coefficients.
TEST(RootCoordinates, HaveExactSlopes) {
  constexpr double kStep = 1e-6;
  const Model model = parsed(kSeasonal);
  Random random(1);
  Dataset data;
  data.y = random.normal(60).transpose();
  data.u.resize(0, 60);
  data.dt = 1.0;
  const std::vector<Dataset> recordings = {data};
  RecordingsLikelihood likelihood(model, recordings);
  const FactorCoordinates factors(model.parameters, {});
  const RootCoordinates roots(model, factors);
  ASSERT_TRUE(roots.any());
  const LikelihoodProblem by_entries = likelihood.problem();
  const LikelihoodProblem problem = roots.problem(by_entries);
  const Eigen::VectorXd z = Eigen::VectorXd{{0.4, -0.3, 0.5, -0.6, 1.3}};
  EXPECT_LT((roots.from(roots.to(z)) - z).cwiseAbs().maxCoeff(), 1e-12);
  double L = 0.0, above = 0.0, below = 0.0;
  Eigen::VectorXd gradient;
  Eigen::MatrixXd information;
  ASSERT_TRUE(problem.evaluate(z, L, &gradient, &information));
  for (Eigen::Index k = 0; k < z.size(); ++k) {
    const Eigen::VectorXd step = kStep * Eigen::VectorXd::Unit(z.size(), k);
    ASSERT_TRUE(problem.evaluate(z + step, above, nullptr, nullptr));
    ASSERT_TRUE(problem.evaluate(z - step, below, nullptr, nullptr));
    EXPECT_NEAR(gradient[k], (above - below) / (2.0 * kStep), 1e-5 * std::abs(L));
  }
}

const char kMovingAverage[] = R"(
parameters: {m: {value: 0}, q: {value: 1, min: 0}}
A: [[0, 0], [1, 0]]
G: [[1], [0]]
C: [[1, m]]
Q: [[q]]
R: [[0]]
initial: stationary
outputs: [{name: y, column: y}]
)";

Dataset difference_of_noise(Eigen::Index N) {
  Random random(3);
  const Eigen::VectorXd e = random.normal(N + 1);
  Dataset out;
  out.y = (e.tail(N) - e.head(N)).transpose();
  out.u.resize(0, N);
  out.dt = 1.0;
  out.time = Eigen::VectorXd::LinSpaced(N, 0.0, static_cast<double>(N - 1));
  out.outputs = {Channel{"y", "", false}};
  return out;
}

// A difference taken twice leaves a root on the unit circle: a statement, with an error of what else
// is free, where slopes by the coefficient vanish whatever the data.
TEST(RootCoordinates, AMovingAverageOnTheCircleIsAStatement) {
  const Dataset data = difference_of_noise(300);
  const NoiseEstimate e = tune_ml(parsed(kMovingAverage), {data});
  EXPECT_EQ(e.parameters[0].value, -1.0);
  EXPECT_EQ(e.parameters[0].verdict, Verdict::at_bound);
  EXPECT_EQ(e.status, Status::ok);
  EXPECT_EQ(e.identifiability.rank, e.identifiability.of);
  EXPECT_NEAR(e.parameters[1].se, e.parameters[1].value * std::sqrt(2.0 / 300.0), 1e-3);
}

}  // namespace
}  // namespace identikal
