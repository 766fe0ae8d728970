// Student's t as measurement noise: against the t-distribution itself where the state is known,
// against a normal model where nothing has heavy tails, and against the truth where it has.
#include "identify/noise/student.h"

#include <cmath>
#include <string>

#include <gtest/gtest.h>

#include "identify/filter/model_filter.h"
#include "identify/filter/student_filter.h"
#include "identify/model/model_file.h"
#include "lib/base/error.h"
#include "lib/base/random.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

std::string level_text(const std::string& measurement,
                       const std::string& q = "{value: 0.1, min: 0}",
                       const std::string& dynamics = "x") {
  return "identikal: 1\nname: level\ntime: {step: 1 s, kind: discrete}\n"
         "parameters: {q: " +
         q +
         ", r: {value: 1, min: 0}, nu: {value: 5, min: 1}}\n"
         "states: [x]\ndynamics: {x: " +
         dynamics +
         "}\noutputs: {y: {column: y, equals: x}}\n"
         "noise: {process: {variance: {x: q}}, measurement: {" +
         measurement + "variance: {y: r}}}\ninitial: {mean: {x: 0}, sd: {x: 0}}\n";
}

// The file needs nu to be used.
Model level(const std::string& freedom, const std::string& q = "{value: 0.1, min: 0}",
            const std::string& dynamics = "x") {
  std::string text = level_text("kind: student, freedom: " + freedom + ", ", q, dynamics);
  if (freedom != "nu")
    text.erase(text.find(", nu:"), std::string(", nu: {value: 5, min: 1}").size());
  return parse_model_file(text, "level.yaml");
}

// v = scale t(nu): a normal over the root of a mean square of nu normals.
double draw_student(Random& random, int freedom) {
  double squares = 0.0;
  for (int i = 0; i < freedom; ++i) squares += std::pow(random.normal(), 2);
  return random.normal() / std::sqrt(squares / freedom);
}

Dataset drawn(double q, double scale, int freedom, Index rows, std::uint64_t seed,
              VectorXd* truth = nullptr) {
  Random random(seed);
  Dataset out;
  out.name = "drawn";
  out.dt = 1.0;
  out.time = VectorXd::LinSpaced(rows, 0.0, static_cast<double>(rows - 1));
  out.u.resize(0, rows);
  out.y.resize(1, rows);
  out.outputs = {{"y", ""}};
  double x = 0.0;
  if (truth != nullptr) truth->resize(rows);
  for (Index t = 0; t < rows; ++t) {
    const double v = freedom > 0 ? draw_student(random, freedom) : random.normal();
    out.y(0, t) = x + scale * v;
    if (truth != nullptr) (*truth)[t] = x;
    x += std::sqrt(q) * random.normal();
  }
  return out;
}

double log_t(double e, double scale, double nu) {
  return std::lgamma(0.5 * (nu + 1)) - std::lgamma(0.5 * nu) - 0.5 * std::log(nu * M_PI) -
         std::log(scale) - 0.5 * (nu + 1) * std::log1p(e * e / (nu * scale * scale));
}

TEST(Student, OfAKnownStateIsTheTDistribution) {
  Model model = level("3", "0");
  model.parameters[0].fixed = true;
  const Dataset data = drawn(0.0, 2.0, 3, 200, 1);
  model.parameters[1].value(0, 0) = 4.0;
  const StudentRun run = StudentFilter(model, data).run(model.parameters);
  EXPECT_NEAR(run.filter.log_likelihood, run.log_density.sum(), 1e-9);
  for (Index t = 0; t < data.size(); ++t) {
    EXPECT_NEAR(run.log_density[t], log_t(data.y(0, t), 2.0, 3.0), 2e-6);
    const double lambda = 4.0 / (3.0 + data.y(0, t) * data.y(0, t) / 4.0);
    EXPECT_NEAR(run.weight(0, t), lambda, 1e-6 * lambda);
  }
}

TEST(Student, OfAKnownStateHasTheLikeliestScaleAndFreedom) {
  const Model model = level("nu", "0");
  const Dataset data = drawn(0.0, 2.0, 4, 1500, 2);
  const NoiseEstimate found = tune_student(model, {data});
  const double r = found.parameters[1].value, nu = found.parameters[2].value;
  const auto L = [&](double variance, double freedom) {
    double out = 0.0;
    for (const double e : data.y.row(0)) out += log_t(e, std::sqrt(variance), freedom);
    return out;
  };
  EXPECT_NEAR(found.objective.log_likelihood, L(r, nu), 1e-3);
  for (const double factor : {0.97, 1.03}) {
    EXPECT_LT(L(factor * r, nu), L(r, nu) + 1e-3);
    EXPECT_LT(L(r, factor * nu), L(r, nu) + 1e-3);
  }
  EXPECT_NEAR(r, 4.0, 3.0 * found.parameters[1].se);
  EXPECT_NEAR(nu, 4.0, 3.0 * found.parameters[2].se);
}

TEST(Student, FindsTheNoiseThatANormalModelOverestimates) {
  const Dataset data = drawn(0.04, 1.0, 3, 2000, 3);
  Model model = level("3");
  const NoiseEstimate heavy = tune_student(model, {data});
  model.student.reset();
  const NoiseEstimate normal = tune_ml(model, {data});
  EXPECT_NEAR(heavy.parameters[0].value, 0.04, 3.0 * heavy.parameters[0].se);
  EXPECT_LT(heavy.parameters[0].se, 0.008);
  EXPECT_NEAR(heavy.parameters[1].value, 1.0, 0.12);
  EXPECT_GT(normal.parameters[1].value, 2.0);
  EXPECT_GT(heavy.objective.log_likelihood, normal.objective.log_likelihood + 100.0);
  const std::string last = heavy.notes.back();
  EXPECT_NE(last.find("predicts better than a normal distribution"), std::string::npos) << last;
}

TEST(Student, OfNormalNoiseIsNoBetterAndLosesLittle) {
  const Dataset data = drawn(0.04, 1.0, 0, 2000, 4);
  Model model = level("4");
  const NoiseEstimate heavy = tune_student(model, {data});
  EXPECT_NEAR(heavy.parameters[0].value, 0.04, 0.02);
  const std::string last = heavy.notes.back();
  EXPECT_EQ(last.find("predicts better"), std::string::npos) << last;
  const NoiseEstimate free = tune_student(level("nu"), {data});
  EXPECT_GT(free.parameters[2].value, 20.0);
  EXPECT_NEAR(free.parameters[1].value, 1.0, 0.1);
}

TEST(Student, FilteredStatesAreCloserToTheTruth) {
  VectorXd truth;
  const Dataset data = drawn(0.04, 1.0, 2, 3000, 5, &truth);
  const auto rms = [&](const Model& model) {
    const FilterResult filter = run_filter(model, model.parameters, data);
    return std::sqrt((filter.x_filt.row(0).transpose() - truth).squaredNorm() / 3000.0);
  };
  Model heavy = level("2");
  heavy.parameters[0].value(0, 0) = 0.04;
  const double ours = rms(heavy);
  // A normal filter with the R that maximum likelihood gives it.
  Model normal = heavy;
  normal.student.reset();
  const NoiseEstimate tuned = tune_ml(normal, {data});
  for (std::size_t i = 0; i < 2; ++i) normal.parameters[i].value(0, 0) = tuned.parameters[i].value;
  EXPECT_LT(ours, 0.85 * rms(normal));
}

// The covariance is right: errors of the states over it have the size one, where normal weights
// alone leave it too small.
TEST(Student, TheCovarianceIsThatOfTheErrors) {
  VectorXd truth;
  Model model = level("3");
  model.parameters[0].value(0, 0) = 0.04;
  double nees = 0.0, squares = 0.0;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const Dataset data = drawn(0.04, 1.0, 3, 2000, 100 + seed, &truth);
    const FilterResult filter = run_filter(model, model.parameters, data);
    for (Index t = 1; t < data.size(); ++t) {
      nees += std::pow(filter.x_filt(0, t) - truth[t], 2) /
              filter.P_filt[static_cast<std::size_t>(t)](0, 0) / 19990.0;
      squares += std::pow(filter.standardised(0, t), 2) / 19990.0;
    }
  }
  EXPECT_NEAR(nees, 1.0, 0.06);
  EXPECT_NEAR(squares, 1.0, 0.03);
}

// An extended filter is the same where a model is linear but for a term of no size.
TEST(Student, GoesThroughAnExtendedFilterToo) {
  const Dataset data = drawn(0.04, 1.0, 3, 1500, 6);
  const Model linear = level("3"), curved = level("3", "{value: 0.1, min: 0}", "x + 1e-9*sin(x)");
  ASSERT_TRUE(is_formula_model(curved));
  const VectorXd a = StudentFilter(linear, data).run(linear.parameters).log_density;
  const VectorXd b = StudentFilter(curved, data).run(curved.parameters).log_density;
  EXPECT_LT((a - b).cwiseAbs().maxCoeff(), 1e-6);
  const NoiseEstimate of_linear = tune_student(linear, {data}),
                      of_curved = tune_student(curved, {data});
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_NEAR(of_curved.parameters[i].value / of_linear.parameters[i].value, 1.0, 0.01);
  }
}

TEST(Student, RefusesWhatHasNoWeightOfItsOwn) {
  const std::string text =
      "identikal: 1\ntime: {step: 1 s}\nparameters: {r: {value: 1, min: 0}}\nA: [[0.5]]\nC: "
      "[[1],[1]]\nQ: [[1]]\nR: [[r, 0.5], [0.5, r]]\nnoise: {measurement: {kind: student}}\n"
      "outputs: [{name: a}, {name: b}]\n";
  Dataset data = drawn(0.1, 1.0, 0, 100, 7);
  data.y.conservativeResize(2, Eigen::NoChange);
  data.y.row(1) = data.y.row(0) * 1.1;
  data.outputs = {{"a", ""}, {"b", ""}};
  EXPECT_THROW(tune_student(parse_model_file(text, "m.yaml"), {data}), InputError);
  EXPECT_THROW(level("0.5"), InputError);
  EXPECT_THROW(level("mu"), InputError);
}

}  // namespace
}  // namespace identikal
