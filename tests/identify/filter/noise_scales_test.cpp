// Measurement noise whose size follows the prediction, inputs or time: against densities written out,
// finite differences, and models whose noise stays.
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "identify/filter/model_filter.h"
#include "identify/filter/recordings_likelihood.h"
#include "identify/model/model_file.h"
#include "identify/model/recording.h"
#include "lib/base/random.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// A tank that empties; %NOISE% is what the cases differ in.
std::string emptying_tank(const std::string& process, const std::string& measurement) {
  return R"(identikal: 1
time: {kind: continuous, step: 1 s}
parameters:
  k: {value: 0.35, min: 0}
  h0: {value: 4}
  a: {value: 0.2, min: 0}
  b: {value: 0.15, min: 0}
inputs: {w: {column: w}}
states: [h]
let: {level: h + 0*a}
dynamics: {h: '-k*sqrt(max(h, 1e-6)) + 0*w + 0*b'}
outputs: {y: {column: y, equals: level}, z: {column: z, equals: h^2}}
noise:
)" + process +
         "  measurement: " + measurement + "\ninitial: {mean: {h: h0}, sd: {h: 0.3}}\n";
}

constexpr const char* kTankDensity = "  process: {kind: density, sd: {h: 0.05}}\n";

std::vector<Dataset> recordings_of(const Model& model) {
  constexpr Index kRows = 12;
  Random random(5);
  MatrixXd y(2, kRows);
  for (Index t = 0; t < kRows; ++t) {
    const double h = std::pow(std::max(0.0, 2.0 - 0.17 * static_cast<double>(t)), 2);
    y(0, t) = h + 0.2 * random.normal();
    y(1, t) = h * h + 0.4 * random.normal();
  }
  y(0, 4) = std::nan("");
  const VectorXd w = 1.0 + 0.5 * VectorXd::LinSpaced(kRows, 0.0, 6.0).array().sin();
  return {recording(model, Samples(y), 1.0, Samples(w))};
}

struct ScaleCase {
  const char* name;
  const char *process, *measurement, *filter;
};

const std::vector<ScaleCase>& scale_cases() {
  static const std::vector<ScaleCase> all = {
      {"prediction", "", "{sd: {y: a + b*level, z: 0.3}}", ""},
      {"variance", "", "{variance: {y: a^2 + (b*h)^2, z: a + b}}", ""},
      {"input", "", "{sd: {y: a*w, z: a + b*w}}", ""},
      {"time", "", "{sd: {y: a*exp(-0.1*t), z: 0.5}}", ""},
      {"extended", kTankDensity, "{sd: {y: a + b*level, z: 0.5*w}}", ""},
      {"iterated", kTankDensity, "{sd: {y: a + b*level, z: 0.5*w}}", "iterated"},
      {"unscented", kTankDensity, "{sd: {y: a + b*level, z: 0.5*w}}", "unscented"}};
  return all;
}

Model model_of_case(const ScaleCase& c) {
  Model model = parse_model_file(emptying_tank(c.process, c.measurement), "tank.yaml");
  if (c.filter[0] != '\0') as_formulas(model).filter = nonlinear_method(c.filter, {});
  return model;
}

class MovingNoise : public testing::TestWithParam<std::size_t> {};

TEST_P(MovingNoise, GradientIsThatOfDifferences) {
  const Model model = model_of_case(scale_cases()[GetParam()]);
  ASSERT_TRUE(as_formulas(model).noise_scales.has_value());
  const std::vector<Dataset> data = recordings_of(model);
  RecordingsLikelihood likelihood(model, data);
  const Likelihood* at = likelihood.evaluate(model.parameters, true);
  ASSERT_NE(at, nullptr);
  const VectorXd gradient = at->gradient, x = free_entries(model.parameters);
  for (Index i = 0; i < x.size(); ++i) {
    const double step = 1e-5 * std::max(0.1, std::abs(x[i]));
    VectorXd moved = x;
    moved[i] += step;
    const double above = likelihood.evaluate(with_entries(model.parameters, moved), false)->value;
    moved[i] -= 2.0 * step;
    const double below = likelihood.evaluate(with_entries(model.parameters, moved), false)->value;
    EXPECT_NEAR(gradient[i], (above - below) / (2.0 * step),
                2e-6 * std::max(1.0, std::abs(gradient[i])))
        << i;
  }
}

INSTANTIATE_TEST_SUITE_P(Forms, MovingNoise, testing::Values(0, 1, 2, 3, 4, 5, 6),
                         [](const auto& p) { return scale_cases()[p.param].name; });

// Rows of a regression are independent: the log-likelihood is a sum of normal log-densities.
TEST(MovingNoiseOfARegression, MakeTheSumOfItsLogDensities) {
  const Model model = parse_model_file(R"(identikal: 1
model: static
parameters: {c: {value: 2}, a: {value: 0.2, min: 0}, b: {value: 0.15, min: 0}}
inputs: {x: {column: x}, sd_y: {column: sd_y}}
let: {level: c*x^2}
outputs: {y: {column: y, equals: level}}
noise: {measurement: {sd: {y: 'hypot(a*sd_y, b*level)'}}}
)",
                                       "regression.yaml");
  const VectorXd x{{0.5, 1.0, 1.5, 2.0}}, sd{{1.0, 2.0, 1.0, 0.5}}, y{{0.7, 1.5, 5.0, 8.2}};
  MatrixXd u(2, 4);
  u << x.transpose(), sd.transpose();
  double sum = 0.0;
  for (Index t = 0; t < 4; ++t) {
    const double mean = 2.0 * x[t] * x[t], s = std::hypot(0.2 * sd[t], 0.15 * mean);
    sum -= 0.5 * std::pow((y[t] - mean) / s, 2) + std::log(s * std::sqrt(2.0 * std::numbers::pi));
  }
  const std::vector<Dataset> data{recording(model, Samples(y), 1.0, Samples(u))};
  RecordingsLikelihood likelihood(model, data);
  EXPECT_NEAR(likelihood.evaluate(model.parameters, false)->value, sum, 1e-12 * std::abs(sum));
  EXPECT_NEAR(run_filter(model, model.parameters, data[0]).log_likelihood, sum, 1e-12);
}

// A scale that is a number is R.
TEST(MovingNoiseThatStay, ArePartOfR) {
  const auto with = [](const char* measurement, const char* filter) {
    return model_of_case({"", kTankDensity, measurement, filter});
  };
  for (const char* filter : {"", "iterated", "unscented"}) {
    const Model scaled = with("{sd: {y: a + 0*h, z: 0.5 + 0*w}}", filter);
    const Model plain = with("{sd: {y: a, z: 0.5}}", filter);
    const std::vector<Dataset> data = recordings_of(plain);
    const FilterResult one = run_filter(scaled, scaled.parameters, data[0]);
    const FilterResult other = run_filter(plain, plain.parameters, data[0]);
    EXPECT_NEAR(one.log_likelihood, other.log_likelihood, 1e-10);
    EXPECT_TRUE(one.x_filt.isApprox(other.x_filt, 1e-12));
    const SmootherResult a = run_smoother(scaled, scaled.parameters, data[0], std::nullopt);
    const SmootherResult b = run_smoother(plain, plain.parameters, data[0], std::nullopt);
    EXPECT_TRUE(a.x.isApprox(b.x, 1e-10));
    EXPECT_TRUE(a.sd.isApprox(b.sd, 1e-8));
  }
}

// A parameter that is a factor of the whole stands in R, and the rest is the scale.
TEST(MovingNoiseWithAFactor, HasItInR) {
  const auto regression = [](const char* sd) {
    return parse_model_file(std::string(R"(identikal: 1
model: static
parameters: {c: {value: 2}, a: {value: 0.2, min: 0}, b: {value: 0.5, min: 0}}
inputs: {x: {column: x}, w: {column: w}}
let: {level: c*x}
outputs: {y: {column: y, equals: level}}
noise: {measurement: {sd: {y: )") +
                                sd + "}}}\n",
                            "regression.yaml");
  };
  const VectorXd x{{0.5, 1.0, 1.5, 2.0}}, y{{0.7, 1.5, 3.5, 4.2}};
  MatrixXd u(2, 4);
  u << x.transpose(), VectorXd{{1.0, 2.0, 1.0, 0.5}}.transpose();
  const auto likelihood_of = [&](const char* sd) {
    const Model model = regression(sd);
    return run_filter(model, model.parameters, recording(model, Samples(y), 1.0, Samples(u)))
        .log_likelihood;
  };
  const Model factored = regression("a*w*(1 + b*level)"), whole = regression("a + w*b*level");
  const auto R = [](const Model& model) {
    return written_matrices(noise_model(model), model.parameters).R(0, 0);
  };
  EXPECT_NEAR(R(factored), 0.04, 1e-15);
  EXPECT_EQ(R(whole), 1.0);
  EXPECT_NEAR(likelihood_of("a*w*(1 + b*level)"), likelihood_of("a*w + a*w*b*level"), 1e-12);
}

TEST(MovingNoiseThatVanish, MakeNoLikelihood) {
  const Model model = model_of_case({"", "", "{sd: {y: 'a*(h - 3)', z: 0.3}}", ""});
  const std::vector<Dataset> data = recordings_of(model);
  RecordingsLikelihood likelihood(model, data);
  EXPECT_EQ(likelihood.evaluate(model.parameters, false), nullptr);
}

// Drawn outputs scatter as the formula says.
TEST(MovingNoiseOfSimulations, AreThoseOfTheFormula) {
  const Model model = parse_model_file(R"(identikal: 1
model: static
parameters: {c: {value: 2}, b: {value: 0.1, min: 0}}
inputs: {x: {column: x}}
let: {level: c*x}
outputs: {y: {column: y, equals: level}}
noise: {measurement: {sd: {y: b*level}}}
)",
                                       "regression.yaml");
  const Index kRows = 20000;
  const VectorXd x = VectorXd::LinSpaced(kRows, 1.0, 3.0);
  const Dataset data = recording(model, Samples(VectorXd(VectorXd::Zero(kRows))), 1.0, Samples(x));
  Random random(9);
  const VectorXd y = simulate_nonlinear_outputs(model, data, random).y.row(0);
  const VectorXd z = (y - 2.0 * x).cwiseQuotient(0.2 * x);
  EXPECT_NEAR(z.squaredNorm() / static_cast<double>(kRows), 1.0, 0.04);  // four standard errors
}

}  // namespace
}  // namespace identikal
