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
#include "lib/base/random.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

struct Certified {
  const char* name;
  std::string unknowns, formula;
  std::vector<double> x, y, value, error;
};

// NIST Statistical Reference Datasets, nonlinear regression, both the data and the certified numbers
// (itl.nist.gov/div898/strd/nls). From the second start of each.
const std::vector<Certified>& certified() {
  static const std::vector<Certified> all = {
      {"Misra1a",
       "b1: 250\n  b2: 5e-4",
       "b1*(1 - exp(-b2*x))",
       {77.6, 114.9, 141.1, 190.8, 239.9, 289.0, 332.8, 378.4, 434.8, 477.3, 536.8, 593.1, 689.1,
        760.0},
       {10.07, 14.73, 17.94, 23.93, 29.61, 35.18, 40.02, 44.82, 50.76, 55.05, 61.01, 66.40, 75.47,
        81.78},
       {2.3894212918e2, 5.5015643181e-4},
       {2.7070075241, 7.2668688436e-6}},
      {"DanWood",
       "b1: 0.7\n  b2: 4",
       "b1*x^b2",
       {1.309, 1.471, 1.490, 1.565, 1.611, 1.680},
       {2.138, 3.421, 3.597, 4.340, 4.882, 5.660},
       {7.6886226176e-1, 3.8604055871},
       {1.8281973860e-2, 5.1726610913e-2}},
      {"MGH10",
       "b1: 0.02\n  b2: 4000\n  b3: 250",
       "b1*exp(b2/(x + b3))",
       {50, 55, 60, 65, 70, 75, 80, 85, 90, 95, 100, 105, 110, 115, 120, 125},
       {34780, 28610, 23650, 19630, 16370, 13720, 11540, 9744, 8261, 7030, 6005, 5147, 4427, 3820,
        3307, 2872},
       {5.6096364710e-3, 6.1813463463e3, 3.4522363462e2},
       {1.5687892471e-4, 2.3309021107e1, 7.8486103508e-1}}};
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
  const Model model = static_model(c.unknowns, c.formula);
  ASSERT_TRUE(rows_have_no_order(model, model.parameters));
  const NoiseEstimate found =
      tune_ml(model, {recording(model, Samples(vector_of(c.y)), 1.0, Samples(vector_of(c.x)))});
  EXPECT_EQ(found.status, Status::ok) << found.message;
  for (std::size_t i = 0; i < c.value.size(); ++i) {
    EXPECT_NEAR(found.parameters[i].value, c.value[i], 1e-8 * std::abs(c.value[i]));
    EXPECT_NEAR(found.parameters[i].se, c.error[i], 1e-6 * c.error[i]);
  }
  EXPECT_EQ(found.covariance_freedom, static_cast<double>(c.x.size() - c.value.size()));
}

INSTANTIATE_TEST_SUITE_P(Nist, RegressionErrors, testing::Values(0, 1, 2),
                         [](const auto& p) { return certified()[p.param].name; });

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
