// Models without motion: parameters and standard errors as NIST certifies them, and intervals that
// cover.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "identify/model/model_file.h"
#include "identify/model/recording.h"
#include "identify/model/row_order.h"
#include "identify/noise/ml.h"
#include "lib/base/constants.h"
#include "lib/base/random.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

struct Certified {
  const char* name;
  std::string unknowns, from_afar, formula;
  std::vector<double> x, y, value, error;
  double residual;  // standard deviation
};

// NIST Statistical Reference Datasets, nonlinear regression, both the data and the certified numbers
// (itl.nist.gov/div898/strd/nls). From the second start of each, and from the first.
const std::vector<Certified>& certified() {
  static const std::vector<Certified> all = {
      {"Misra1a",
       "b1: 250\n  b2: 5e-4",
       "b1: 500\n  b2: 1e-4",
       "b1*(1 - exp(-b2*x))",
       {77.6, 114.9, 141.1, 190.8, 239.9, 289.0, 332.8, 378.4, 434.8, 477.3, 536.8, 593.1, 689.1,
        760.0},
       {10.07, 14.73, 17.94, 23.93, 29.61, 35.18, 40.02, 44.82, 50.76, 55.05, 61.01, 66.40, 75.47,
        81.78},
       {2.3894212918e2, 5.5015643181e-4},
       {2.7070075241, 7.2668688436e-6},
       1.0187876330e-1},
      {"DanWood",
       "b1: 0.7\n  b2: 4",
       "b1: 1\n  b2: 5",
       "b1*x^b2",
       {1.309, 1.471, 1.490, 1.565, 1.611, 1.680},
       {2.138, 3.421, 3.597, 4.340, 4.882, 5.660},
       {7.6886226176e-1, 3.8604055871},
       {1.8281973860e-2, 5.1726610913e-2},
       3.2853114039e-2},
      {"MGH10",
       "b1: 0.02\n  b2: 4000\n  b3: 250",
       "b1: 2\n  b2: 400000\n  b3: 25000",
       "b1*exp(b2/(x + b3))",
       {50, 55, 60, 65, 70, 75, 80, 85, 90, 95, 100, 105, 110, 115, 120, 125},
       {34780, 28610, 23650, 19630, 16370, 13720, 11540, 9744, 8261, 7030, 6005, 5147, 4427, 3820,
        3307, 2872},
       {5.6096364710e-3, 6.1813463463e3, 3.4522363462e2},
       {1.5687892471e-4, 2.3309021107e1, 7.8486103508e-1},
       2.6009740065}};
  return all;
}

Model static_model(const std::string& unknowns, const std::string& formula) {
  const std::string free = "  " + unknowns;
  std::string text = "identikal: 1\nmodel: static\nparameters:\n";
  std::size_t from = 0;
  while (from < free.size()) {
    const std::size_t end = std::min(free.find('\n', from), free.size());
    const std::string line = free.substr(from, end - from);
    const std::size_t colon = line.find(':');
    text += line.substr(0, colon) + ": {value: " + line.substr(colon + 1) + "}\n";
    from = end + 1;
  }
  text += "  s: {value: 1, min: 0}\ninputs: {x: {column: x}}\n";
  text += "outputs: {y: {column: y, equals: '" + formula + "'}}\n";
  return parse_model_file(text + "noise: {measurement: {sd: {y: s}}}\n", "static.yaml");
}

VectorXd vector_of(const std::vector<double>& all) {
  return Eigen::Map<const VectorXd>(all.data(), static_cast<Index>(all.size()));
}

class RegressionErrors : public testing::TestWithParam<std::size_t> {};

TEST_P(RegressionErrors, AreThoseThatNistCertifies) {
  const Certified& c = certified()[GetParam()];
  for (const std::string& start : {c.unknowns, c.from_afar}) {
    const Model model = static_model(start, c.formula);
    ASSERT_TRUE(rows_have_no_order(model, model.parameters));
    NoiseMlOptions options;
    options.starts = 1;
    const NoiseEstimate found = tune_ml(
        model, {recording(model, Samples(vector_of(c.y)), 1.0, Samples(vector_of(c.x)))}, options);
    EXPECT_EQ(found.status, Status::ok) << found.message;
    for (std::size_t i = 0; i < c.value.size(); ++i) {
      EXPECT_NEAR(found.parameters[i].value, c.value[i], 1e-8 * std::abs(c.value[i]));
      EXPECT_NEAR(found.parameters[i].se, c.error[i], 1e-6 * c.error[i]);
    }
    EXPECT_EQ(found.covariance_freedom, static_cast<double>(c.x.size() - c.value.size()));
    ASSERT_EQ(found.derived.size(), 1u);
    EXPECT_NEAR(found.derived[0].value, c.residual, 1e-8 * c.residual);
  }
}

INSTANTIATE_TEST_SUITE_P(Nist, RegressionErrors, testing::Values(0, 1, 2),
                         [](const auto& p) { return certified()[p.param].name; });

// A saturation that the first row has reached already: how fast, nobody can tell. With a true rate of
// 20, exp(-20 x) at x = 0.5 is 5e-5, and the noise 0.01; of exp(-b/2) = 0.01 b is 9.
TEST(RegressionSearch, ARateThatIsBoundedFromBelowOnlyIsSaidToBe) {
  const VectorXd x = VectorXd::LinSpaced(30, 0.5, 5.0);
  Random random(2);
  const VectorXd y = (2.0 * (1.0 - (-20.0 * x.array()).exp())).matrix() + 0.01 * random.normal(30);
  Model model = static_model("a: 1.5\n  b: 30", "a*(1 - exp(-b*x))");
  model.parameters[1].min = 0.0;
  NoiseMlOptions options;
  options.starts = 1;
  const NoiseEstimate found =
      tune_ml(model, {recording(model, Samples(y), 1.0, Samples(x))}, options);
  const EstimatedParameter& b = found.parameters[1];
  EXPECT_EQ(found.status, Status::rejected) << found.message;
  EXPECT_EQ(b.verdict, Verdict::not_identifiable);
  EXPECT_TRUE(std::isnan(b.se));
  EXPECT_GT(b.ci95[0], 6.0);
  EXPECT_LT(b.ci95[0], 20.0);
  EXPECT_TRUE(std::isinf(b.ci95[1]));
  EXPECT_NEAR(found.parameters[0].value, 2.0, 0.006);
  EXPECT_TRUE(std::isfinite(found.parameters[0].se));
}

// NIST's MGH17 from its first start: two exponentials become one during the search, where
// slopes vanish.
TEST(RegressionSearch, LeavesTheRidgeWhereTwoTermsAreOne) {
  const VectorXd x = VectorXd::LinSpaced(33, 0.0, 320.0);
  const VectorXd y{{0.844, 0.908, 0.932, 0.936, 0.925, 0.908, 0.881, 0.850, 0.818, 0.784, 0.751,
                    0.718, 0.685, 0.658, 0.628, 0.603, 0.580, 0.558, 0.538, 0.522, 0.506, 0.490,
                    0.478, 0.467, 0.457, 0.448, 0.438, 0.431, 0.424, 0.420, 0.414, 0.411, 0.406}};
  const Model model = static_model("b1: 50\n  b2: 150\n  b3: -100\n  b4: 1\n  b5: 2",
                                   "b1 + b2*exp(-x*b4) + b3*exp(-x*b5)");
  NoiseMlOptions options;
  options.starts = 1;
  const NoiseEstimate found =
      tune_ml(model, {recording(model, Samples(y), 1.0, Samples(x))}, options);
  EXPECT_EQ(found.status, Status::ok) << found.message;
  const double squares = 33.0 * std::pow(found.parameters[5].value, 2);
  EXPECT_NEAR(squares, 5.4648946975e-5, 1e-8 * squares);
  const double slow = std::min(found.parameters[3].value, found.parameters[4].value);
  EXPECT_NEAR(slow, 1.2867534640e-2, 1e-7 * slow);
}

TEST(RegressionErrorsOfFewRows, AreTimesARootOfNOverNLessPThoseOfTheLikelihood) {
  const Certified& c = certified()[1];
  const Model model = static_model(c.unknowns, c.formula);
  const std::vector<Dataset> data{
      recording(model, Samples(vector_of(c.y)), 1.0, Samples(vector_of(c.x)))};
  NoiseMlOptions options;
  options.errors = NoiseSize::likelihood;
  const NoiseEstimate plain = tune_ml(model, data, options), usual = tune_ml(model, data);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(usual.parameters[i].se / plain.parameters[i].crb_se, std::sqrt(6.0 / 4.0), 1e-9);
  }
  EXPECT_TRUE(std::isnan(plain.covariance_freedom));
}

// A line through seven points, 1000 times: 95 % intervals of both coefficients by Student's t. By
// chance outside 930 to 970 once in 260.
TEST(RegressionErrorsOfFewRows, IntervalsCover) {
  const Model model = static_model("a: 0.8\n  b: 2.2", "a + b*x");
  const VectorXd x = VectorXd::LinSpaced(7, -1.0, 2.0);
  Random random(11);
  int held[2] = {0, 0};
  for (int i = 0; i < 1000; ++i) {
    const VectorXd y = (1.0 + 2.0 * x.array()).matrix() + 0.3 * random.normal(7);
    const NoiseEstimate found = tune_ml(model, {recording(model, Samples(y), 1.0, Samples(x))});
    for (int k = 0; k < 2; ++k) {
      const auto& ci = found.parameters[static_cast<std::size_t>(k)].ci95;
      held[k] += ci[0] <= k + 1.0 && k + 1.0 <= ci[1] ? 1 : 0;
    }
  }
  std::printf("covered: %d and %d of 1000\n", held[0], held[1]);
  for (const int k : held) {
    EXPECT_GE(k, 930);
    EXPECT_LE(k, 970);
  }
}

// A curve of which the recording shows the beginning: how high it ends is bounded from below only,
// where the sum of squares is 1 + t^2 / (n - p) times the least (Bates & Watts 1988, section 6.1).
TEST(StaticModel, AnIntervalMayHaveNoEnd) {
  constexpr Index kRows = 12;
  Random random(3);
  VectorXd x(kRows), y(kRows);
  for (Index i = 0; i < kRows; ++i) {
    x[i] = static_cast<double>(i + 1);
    y[i] = 20.0 * (1.0 - std::exp(-0.05 * x[i])) + 0.6 * random.normal();
  }
  const Model model = static_model("b1: 10\n  b2: 0.1", "b1*(1 - exp(-b2*x))");
  const NoiseEstimate e = tune_ml(model, {recording(model, Samples(y), 1.0, Samples(x))});
  const EstimatedParameter& b1 = e.parameters[0];
  EXPECT_TRUE(std::isinf(b1.profile95[1])) << b1.profile95[1];
  const auto squares = [&](double height, double rate) {
    return (y.array() - height * (1.0 - (-rate * x.array()).exp())).square().sum();
  };
  const auto least_squares = [&](double height) {
    double best = kInfinity;
    for (double rate = 1e-7; rate < 1.0; rate *= 1.0002) {
      best = std::min(best, squares(height, rate));
    }
    return best;
  };
  constexpr double kT = 2.228139;  // Student's t, 10 degrees of freedom, 97.5 %
  const double least = squares(b1.value, e.parameters[1].value);
  EXPECT_NEAR(least_squares(b1.profile95[0]) / least, 1.0 + kT * kT / 10.0, 1e-3);
  EXPECT_LT(least_squares(1e6) / least, 1.0 + kT * kT / 10.0);
}

TEST(StaticModel, RefusesWhatMoves) {
  const auto refused = [](const std::string& more) {
    try {
      parse_model_file("identikal: 1\nmodel: static\nparameters: {a: {value: 1}, s: 1}\n" + more +
                           "inputs: {x: {column: x}}\noutputs: {y: {column: y, equals: a*x}}\n",
                       "static.yaml");
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  const std::string noise = "noise: {measurement: {sd: {y: s}}}\n";
  EXPECT_EQ(refused(noise), "");
  EXPECT_NE(refused(noise + "states: [z]\n").find("'states' does not belong to model: static"),
            std::string::npos);
  EXPECT_NE(refused("noise: {process: per-sample, measurement: {sd: {y: s}}}\n").find("process"),
            std::string::npos);
  EXPECT_NE(refused(noise + "time: {kind: continuous, step: 1 s}\n").find("continuous"),
            std::string::npos);
}

}  // namespace
}  // namespace identikal
