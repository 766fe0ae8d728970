// ARX, ARMAX, output-error and Box-Jenkins models of systems that are known: coefficients, errors, bands.
#include <cmath>
#include <cstdio>
#include <limits>
#include <string>

#include <Eigen/Dense>
#include <gtest/gtest.h>

#include "identify/black_box/black_box.h"
#include "identify/model/builder.h"
#include "lib/base/error.h"
#include "lib/base/random.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

struct Driven {
  VectorXd y, u;
};

constexpr double kA1 = -1.5, kA2 = 0.7, kB1 = 0.5, kB2 = 0.3;

// w = (0.5 q^-1 + 0.3 q^-2) / (1 - 1.5 q^-1 + 0.7 q^-2) u, and noise (1 + c q^-1) / (1 + d q^-1) e of 0.3.
Driven driven(Index rows, std::uint64_t seed, double c, double d) {
  Random random(seed);
  Driven out{VectorXd(rows), VectorXd(rows)};
  double w1 = 0.0, w2 = 0.0, u1 = 0.0, u2 = 0.0, v = 0.0, before = 0.0;
  for (Index t = -50; t < rows; ++t) {
    const double u = random.normal(), e = 0.3 * random.normal();
    const double w = kB1 * u1 + kB2 * u2 - kA1 * w1 - kA2 * w2;
    v = e + c * before - d * v;
    before = e;
    if (t >= 0) {
      out.y[t] = w + v;
      out.u[t] = u;
    }
    w2 = w1;
    w1 = w;
    u2 = u1;
    u1 = u;
  }
  return out;
}

Model one_channel_each() {
  return linear_model()
      .A(0.0)
      .B(0.0)
      .C(1.0)
      .inputs({"u"})
      .outputs({"y"})
      .process_noise(1.0)
      .measurement_noise(1.0)
      .step(0.1);
}

BlackBoxResult fitted_to(const Driven& record, const BlackBoxOptions& options) {
  const Model model = one_channel_each();
  return estimate_black_box(model, {recording(model, record.y, 0.1, record.u)}, options);
}

const BlackBox::Polynomial& polynomial(const BlackBox& box, const std::string& name) {
  for (const BlackBox::Polynomial& each : box.polynomials) {
    if (each.name == name) return each;
  }
  throw std::runtime_error("no polynomial " + name);
}

TEST(Polynomials, ArxIsTheLeastSquaresOfItsRegression) {
  const Driven record = driven(400, 1, 0.4, 0.0);
  const BlackBox box = fitted_to(record, {.structure = ModelStructure::arx,
                                          .polynomials = PolynomialOrders{.na = 2, .nb = 2},
                                          .delay = 1})
                           .estimate.black_box;
  const VectorXd y = record.y.array() - box.operating_point[1].value,
                 u = record.u.array() - box.operating_point[0].value;
  MatrixXd X(398, 4);
  for (Index t = 2; t < 400; ++t) X.row(t - 2) << -y[t - 1], -y[t - 2], u[t - 1], u[t - 2];
  const VectorXd target = y.tail(398), theta = X.colPivHouseholderQr().solve(target);
  const double variance = (target - X * theta).squaredNorm() / 394.0;
  const VectorXd se = (variance * (X.transpose() * X).inverse().diagonal()).cwiseSqrt();
  EXPECT_LT((polynomial(box, "A").value.tail(2) - theta.head(2)).cwiseAbs().maxCoeff(), 1e-9);
  EXPECT_LT((polynomial(box, "B").value - theta.tail(2)).cwiseAbs().maxCoeff(), 1e-9);
  EXPECT_LT((polynomial(box, "B").se - se.tail(2)).cwiseAbs().maxCoeff(), 1e-9 * se.maxCoeff());
  EXPECT_EQ(polynomial(box, "A").value[0], 1.0);
  EXPECT_EQ(polynomial(box, "A").se[0], 0.0);
  EXPECT_EQ(box.refinement, "arx");
}

// 40 recordings of 800 rows: 95 % intervals of every coefficient, and bands of gain and steps. Of 160 intervals fewer than 138
// hold with a probability of 1e-5 if they were independent; they are not, so that the false-alarm rate is about 1e-3.
struct Hits {
  int covered = 0, counted = 0;
  void count(double value, double se, double truth) {
    covered += std::abs(value - truth) < 1.96 * se;
    ++counted;
  }
  double share() const { return static_cast<double>(covered) / counted; }
};

TEST(Polynomials, OutputErrorCoversTheTruthWhateverTheColourOfTheNoise) {
  Hits coefficients, steps, gains;
  for (std::uint64_t seed = 0; seed < 40; ++seed) {
    const BlackBoxResult result = fitted_to(
        driven(800, 10 + seed, 0.0, -0.9),
        {.structure = ModelStructure::output_error, .least_order = 2, .most_order = 2, .delay = 1});
    const BlackBox& box = result.estimate.black_box;
    ASSERT_EQ(box.order, 2);
    EXPECT_EQ(result.estimate.status, Status::ok) << result.estimate.message;
    const BlackBox::Polynomial &B = polynomial(box, "B"), &F = polynomial(box, "F");
    EXPECT_EQ(B.delay, 1);
    coefficients.count(B.value[0], B.se[0], kB1);
    coefficients.count(B.value[1], B.se[1], kB2);
    coefficients.count(F.value[1], F.se[1], kA1);
    coefficients.count(F.value[2], F.se[2], kA2);
    steps.count(box.step_responses[0].value[1], box.step_responses[0].se[1], kB1);
    steps.count(box.step_responses[0].value[99], box.step_responses[0].se[99], 4.0);
    gains.count(box.gain(0, 0), box.gain_se(0, 0), 4.0);
    const BlackBox::FrequencyResponse& response = box.frequency_responses[0];
    const Index last = response.frequency.size() - 1;
    EXPECT_NEAR(response.frequency[last], 31.4159, 1e-3);
    gains.count(response.gain[last], response.gain_se[last], 0.2 / 3.2);
  }
  std::printf("covered: coefficients %.3f, steps %.3f, gains %.3f\n", coefficients.share(),
              steps.share(), gains.share());
  EXPECT_GE(coefficients.covered, 138);
  EXPECT_GE(steps.covered, 66);  // of 80
  EXPECT_GE(gains.covered, 66);
}

TEST(Polynomials, BoxAndJenkinsFindThePlantAndTheNoise) {
  const BlackBoxResult result = fitted_to(
      driven(4000, 3, 0.0, -0.9), {.structure = ModelStructure::box_jenkins, .most_order = 4});
  const BlackBox& box = result.estimate.black_box;
  EXPECT_EQ(result.estimate.status, Status::ok) << result.estimate.message;
  EXPECT_EQ(box.order, 3);
  const BlackBox::Polynomial &D = polynomial(box, "D"), &F = polynomial(box, "F");
  EXPECT_NEAR(D.value[1], -0.9, 4.0 * D.se[1]);
  EXPECT_NEAR(F.value[1], kA1, 4.0 * F.se[1]);
  EXPECT_LT(F.se[1], 0.01);
}

TEST(Polynomials, ArmaxPredictsAcrossMissingOutputs) {
  Driven record = driven(3000, 4, 0.0, 0.0);
  for (Index t = 7; t < 3000; t += 13) record.y[t] = std::numeric_limits<double>::quiet_NaN();
  const BlackBoxResult result =
      fitted_to(record, {.structure = ModelStructure::armax, .least_order = 2, .most_order = 2});
  // White noise of the output is ARMAX with C = A.
  const BlackBox& box = result.estimate.black_box;
  for (const char* name : {"A", "C"}) {
    const BlackBox::Polynomial& each = polynomial(box, name);
    EXPECT_NEAR(each.value[1], kA1, 4.5 * each.se[1]) << name;
    EXPECT_NEAR(each.value[2], kA2, 4.5 * each.se[2]) << name;
  }
}

TEST(Polynomials, AChangeOfUnitScalesWhatEntersAlone) {
  const Driven record = driven(600, 5, 0.3, -0.5);
  const Driven scaled{1e-6 * record.y, 1e5 * record.u};
  for (const ModelStructure structure : {ModelStructure::armax, ModelStructure::box_jenkins}) {
    const BlackBoxOptions options{.structure = structure, .least_order = 2, .most_order = 2};
    const BlackBox one = fitted_to(record, options).estimate.black_box,
                   other = fitted_to(scaled, options).estimate.black_box;
    for (std::size_t k = 0; k < one.polynomials.size(); ++k) {
      const double scale = one.polynomials[k].name == "B" ? 1e-11 : 1.0;
      EXPECT_LT((one.polynomials[k].value * scale - other.polynomials[k].value).norm(),
                1e-6 * scale);
    }
  }
}

TEST(Polynomials, OfATimeSeriesNeedNoInput) {
  const Model model =
      linear_model().A(0.0).C(1.0).outputs({"y"}).process_noise(1.0).measurement_noise(1.0).step(
          1.0);
  Random random(6);
  VectorXd y(1000);
  double before = 0.0;
  for (double& each : y) each = before = 0.8 * before + random.normal();
  const auto estimate = [&](ModelStructure structure) {
    return estimate_black_box(model, {recording(model, y, 1.0)},
                              {.structure = structure, .least_order = 1, .most_order = 1})
        .estimate.black_box;
  };
  const BlackBox::Polynomial A = polynomial(estimate(ModelStructure::arx), "A");
  EXPECT_NEAR(A.value[1], -0.8, 4.0 * A.se[1]);
  EXPECT_THROW(estimate(ModelStructure::output_error), InputError);
  EXPECT_THROW(fitted_to(driven(100, 1, 0, 0), {.delay = 1}), std::invalid_argument);
}

}  // namespace
}  // namespace identikal
