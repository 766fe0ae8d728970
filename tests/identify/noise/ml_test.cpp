// Maximum likelihood of Q and R against published digits and against the Cramér-Rao bound.
#include "identify/noise/ml.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <Eigen/LU>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "identify/filter/outliers.h"
#include "identify/filter/recordings_likelihood.h"
#include "identify/model/model_file.h"
#include "identify/noise/als.h"
#include "lib/base/error.h"
#include "lib/base/random.h"
#include "lib/data/csv.h"
#include "lib/filter/kalman.h"
#include "tests/support/matisko_systems.h"
#include "tests/support/scalar_case.h"
#include "tests/support/shared_data.h"

namespace identikal {
namespace {

using Eigen::MatrixXd;

std::string in_tree(const std::string& path) {
  return std::string(IDENTIKAL_SOURCE_DIR) + "/" + path;
}

TEST(NoiseMl, NileWithGaps) {
  // Durbin & Koopman (2012), section 2.7: years 21-40 and 61-80 missing. Maximum recomputed with
  // KFAS.
  const Model model = read_model_file(in_tree("examples/nile.yaml"));
  Dataset data =
      make_dataset(read_csv(in_tree("data/nile.csv")), model.time, model.inputs, model.outputs);
  data.y.middleCols(20, 20).setConstant(std::nan(""));
  data.y.middleCols(60, 20).setConstant(std::nan(""));
  const NoiseEstimate e = tune_ml(model, {data});
  EXPECT_EQ(e.status, Status::ok);
  EXPECT_NEAR(e.noise.R(0, 0) / 17899.845, 1.0, 1e-5);
  EXPECT_NEAR(e.noise.Q(0, 0) / 685.8209, 1.0, 1e-5);
  EXPECT_NEAR(e.objective.log_likelihood, -380.007729121, 1e-7);
}

// Of a level under noise, differences have a covariance that sines make diagonal, and Newton's method
// on their likelihood, in long double, ends at these digits. Whatever the start: the search's last
// step is worth no evaluation, but these.
TEST(NoiseMl, NileToTenDigits) {
  Model model = read_model_file(in_tree("examples/nile.yaml"));
  const Dataset data =
      make_dataset(read_csv(in_tree("data/nile.csv")), model.time, model.inputs, model.outputs);
  for (const double times : {1.0, 0.1, 30.0}) {
    Model from = model;
    for (Parameter& p : from.parameters) p.value *= times;
    const NoiseEstimate e = tune_ml(from, {data});
    printf("Nile from %g times the start: q %.12g, r %.12g\n", times, e.noise.Q(0, 0),
           e.noise.R(0, 0));
    EXPECT_NEAR(e.noise.Q(0, 0) / 1469.1763603095183, 1.0, 1e-10);
    EXPECT_NEAR(e.noise.R(0, 0) / 15098.518324096272, 1.0, 1e-10);
  }
}

struct Published {
  const char* file;
  const char* model;
  std::vector<double> truth, maximum, se_log;
  double at_truth, at_maximum;
};

TEST(NoiseMl, PublishedMaxima) {
  // Provenance of the digits: likelihood/cases.json (six independent programs agree).
  const Published cases[] = {
      {"likelihood/sys7.csv",
       "examples/system7.yaml",
       {10, 3, 7, 1.5, 3},
       {9.21621065099, 2.87823454848, 7.1799936505, 1.51481011448, 3.71930221099},
       {.0682803, .06000998, .03892984, .09074935, .1369975},
       -17813.3318494543,
       -17811.7503130},
      {"likelihood/sys1.csv",
       "",
       {10, 1},
       {11.320232133389, .507897093336},
       {.09362707, 1.493285},
       -2660.7048865062,
       -2659.42520808},
  };
  for (const Published& c : cases) {
    IDENTIKAL_NEEDS_SHARED_FILE(c.file);
    const bool file = *c.model != '\0';
    Model model = file ? read_model_file(in_tree(c.model)) : scalar_model(0.5, 1.0, 1.0);
    if (!file) model.outputs = {{"y", "1", "", "", {}}}, model.time.step = 1.0;
    const Dataset data =
        make_dataset(read_csv(shared_file(c.file)), model.time, model.inputs, model.outputs);
    const Eigen::VectorXd truth = Eigen::Map<const Eigen::VectorXd>(
        c.truth.data(), static_cast<Eigen::Index>(c.truth.size()));
    const Likelihood at_truth =
        log_likelihood(instantiate(as_linear(model), with_coordinates(model.parameters, truth)),
                       InitialState::stationary, data.y, data.u);
    std::printf("%s: at the truth %.10f\n", c.file, at_truth.value);
    EXPECT_NEAR(at_truth.value, c.at_truth, 1e-6);
    const NoiseEstimate e = tune_ml(model, {data});
    EXPECT_EQ(e.status, Status::ok);
    std::printf("%s: maximum %.10f\n", c.file, e.objective.log_likelihood);
    EXPECT_NEAR(e.objective.log_likelihood, c.at_maximum, 1e-6);
    for (std::size_t i = 0; i < c.maximum.size(); ++i) {
      const EstimatedParameter& p = e.parameters[i];
      std::printf("  %-7s %.8f  se of its logarithm %.6f (published %.6f)\n", p.name.c_str(),
                  p.value, p.se / p.value, c.se_log[i]);
      EXPECT_NEAR(p.value / c.maximum[i], 1.0, 1e-4);
      EXPECT_NEAR(p.se / p.value / c.se_log[i], 1.0, 0.01);
    }
  }
}

TEST(NoiseMl, StopsWhenToldWithTheBestSoFar) {
  const Model model = read_model_file(in_tree("examples/nile.yaml"));
  const Dataset data =
      make_dataset(read_csv(in_tree("data/nile.csv")), model.time, model.inputs, model.outputs);
  for (const int last_start : {1, 2}) {
    NoiseMlOptions options;
    options.starts = 5;
    int iterations = 0;
    options.progress = [&](int start, int iteration, double) {
      ++iterations;
      return start < last_start || iteration < 2;
    };
    const NoiseEstimate e = tune_ml(model, {data}, options);
    EXPECT_EQ(e.objective.iterations, iterations);
    EXPECT_EQ(e.objective.starts, last_start);
    EXPECT_EQ(e.status, Status::not_converged);
    EXPECT_EQ(exit_code(e, false), 3);
    EXPECT_THAT(e.message, testing::HasSubstr("stopped by the caller"));
    // The first start alone finds the maximum, and it stays; it is not called the answer.
    const double missing = e.objective.log_likelihood + 632.5456251;
    EXPECT_LT(missing, 1e-6);
    if (last_start == 2) {
      EXPECT_GT(missing, -1e-6);
    }
  }
}

TEST(NoiseMl, VarianceAtZeroGetsAnUpperLimitAndNoInterval) {
  // No measurement noise in the data: in about half of the records the maximum lies at r = 0.
  for (std::uint64_t seed = 1; seed < 20; ++seed) {
    const NoiseEstimate e = tune_ml(scalar_model(0.9, 1.0, 1.0),
                                    {dataset_of(simulate_scalar(0.9, 1.0, 0.0, 400, seed))});
    const EstimatedParameter& r = e.parameters[1];
    if (r.verdict != Verdict::at_bound) {
      ASSERT_EQ(e.status, Status::ok);
      continue;
    }
    EXPECT_EQ(e.status, Status::untrusted);  // a sensor without noise
    EXPECT_EQ(r.value, 0.0);
    EXPECT_TRUE(std::isnan(r.se));
    EXPECT_GT(r.ci95[1], 0.0);
    EXPECT_LT(r.ci95[1], 1.0);
    EXPECT_THAT(e.findings[0].text, testing::HasSubstr("not distinguishable from 0"));
    return;
  }
  FAIL() << "no record ended at the bound";
}

TEST(NoiseMl, ProfileIntervalsEndWhereTheLikelihoodHasFallenByHalfAChiSquare) {
  Model model = scalar_model(0.9, 1.0, 1.0);
  const Dataset data = dataset_of(simulate_scalar(0.9, 1.0, 2.0, 300, 5));
  const NoiseEstimate best = tune_ml(model, {data});
  ASSERT_EQ(best.status, Status::ok);
  for (std::size_t i = 0; i < 2; ++i) {
    for (const double end : best.parameters[i].profile95) {
      Model held = model;
      held.parameters[i].value(0, 0) = end;
      held.parameters[i].fixed = true;
      const double drop =
          best.objective.log_likelihood - tune_ml(held, {data}).objective.log_likelihood;
      EXPECT_NEAR(drop, 0.5 * 3.841458820694124, 1e-3);
    }
    EXPECT_LT(best.parameters[i].profile95[0], best.parameters[i].value);
    EXPECT_GT(best.parameters[i].profile95[1], best.parameters[i].value);
  }
}

// Noise with the tails of a Laplace distribution has a fourth moment of 6 sd^4, not 3 sd^4: the
// variance of a variance is 2.5 times as large.
TEST(NoiseMl, SandwichAllowsForHeavyTails) {
  Random random(4);
  MatrixXd y(1, 20000);
  for (Eigen::Index t = 0; t < y.cols(); ++t) {
    const double u = random.uniform() - 0.5;
    y(0, t) = -std::copysign(std::log(1.0 - 2.0 * std::abs(u)), u) / std::sqrt(2.0);
  }
  Model model = scalar_model(0.5, 1.0, 1.0);
  model.parameters[0].value(0, 0) = 0.0;
  model.parameters[0].fixed = true;
  const NoiseEstimate e = tune_ml(model, {dataset_of(y)});
  const EstimatedParameter& r = e.parameters[1];
  printf("sandwich / observed error %.3f, sqrt(2.5) = 1.581\n", r.se_sandwich / r.se);
  // The sample's own fourth moment is known to 5 %.
  EXPECT_NEAR(r.se_sandwich / r.se, std::sqrt(2.5), 0.12);
}

TEST(NoiseMl, RefusesInWords) {
  Model model = scalar_model(0.5, 1.0, 1.0);
  EXPECT_THROW(tune_ml(model, {}), std::invalid_argument);
  Model outside = model;
  as_linear(outside).Q.entries = {{3, 0, 0, 1.0}};
  EXPECT_THROW(tune_ml(outside, {dataset_of(MatrixXd::Random(1, 100))}), std::invalid_argument);
  as_linear(outside).Q.entries = {{0, 0, 7, 1.0}};
  EXPECT_THROW(tune_ml(outside, {dataset_of(MatrixXd::Random(1, 100))}), std::invalid_argument);
  EXPECT_THROW(tune_ml(model, {dataset_of(MatrixXd::Constant(1, 100, 3.0))}), InputError);
  EXPECT_THROW(tune_ml(model, {dataset_of(MatrixXd::Random(1, 2))}), InputError);
  model.parameters[0].fixed = model.parameters[1].fixed = true;
  EXPECT_THROW(tune_ml(model, {dataset_of(MatrixXd::Random(1, 100))}), InputError);
  const auto message = [](const Model& m, const Dataset& data) {
    try {
      tune_ml(m, {data});
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_THAT(message(scalar_model(1.5, 1.0, 1.0), dataset_of(MatrixXd::Random(1, 100))),
              testing::HasSubstr("A has an eigenvalue of size 1.5"));
  EXPECT_THAT(message(scalar_model(0.5, 0.0, 0.0), dataset_of(MatrixXd::Random(1, 100))),
              testing::HasSubstr("not positive definite"));
}

// A sensor without noise is no result; what it may have at most is, and nothing else hides it.
TEST(NoiseMl, MeasurementNoiseOfZeroIsNotTrusted) {
  int found = 0;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const std::vector<Dataset> data = {dataset_of(simulate_scalar(0.5, 1.0, 0.0, 300, seed))};
    const Model model = scalar_model(0.5, 1.0, 1.0);
    for (const bool ml : {true, false}) {
      const NoiseEstimate e = ml ? tune_ml(model, data) : tune_als(model, data);
      if (e.parameters[1].value > 0.0) continue;
      ++found;
      EXPECT_EQ(e.status, Status::untrusted);
      const auto at = std::find_if(e.findings.begin(), e.findings.end(), [](const Finding& f) {
        return f.code == FindingCode::no_measurement_noise;
      });
      ASSERT_NE(at, e.findings.end());
      EXPECT_THAT(at->about, testing::ElementsAre("r", "y1"));
      EXPECT_THAT(at->text,
                  testing::HasSubstr(fmt::format("{:.4g} (95 %)", e.parameters[1].ci95[1])));
      // The limit that it proposes: 1.35 nats below.
      if (!ml) continue;
      Model limited = model;
      limited.parameters[1].value(0, 0) = e.parameters[1].ci95[1];
      limited.parameters[1].fixed = true;
      const NoiseEstimate there = tune_ml(limited, data);
      EXPECT_NEAR(e.objective.log_likelihood - there.objective.log_likelihood, 1.3528, 0.01);
    }
  }
  EXPECT_GT(found, 6);
  // A process variance at zero is an answer, and a known noise of zero is the model's.
  Model still = scalar_model(0.5, 1.0, 1.0);
  int still_ok = 0;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const NoiseEstimate e = tune_ml(still, {dataset_of(simulate_scalar(0.5, 0.0, 1.0, 300, seed))});
    if (e.parameters[0].value > 0.0) continue;
    still_ok += e.status == Status::ok;
    EXPECT_GT(e.parameters[0].ci95[1], 0.0);
  }
  EXPECT_GT(still_ok, 2);
  still.parameters[1].value.setZero();
  still.parameters[1].fixed = true;
  EXPECT_EQ(tune_ml(still, {dataset_of(simulate_scalar(0.5, 1.0, 0.0, 300, 1))}).status,
            Status::ok);
}

// A prior counts as a measurement: the estimate is where the log-likelihood plus the priors'
// log-density is largest, and its errors are those of the curvature there.
TEST(NoiseMl, HonoursStatedPriors) {
  Model model = scalar_model(0.5, 2.0, 2.0);
  model.parameters[0].prior = {Prior::Kind::log_normal, 0.5, 1.5};
  model.parameters[1].prior = {Prior::Kind::normal, 3.0, 0.2};
  const std::vector<Dataset> data = {dataset_of(simulate_scalar(0.5, 2.0, 1.0, 200, 3))};
  const NoiseEstimate e = tune_ml(model, data);
  Model plain = model;
  for (Parameter& p : plain.parameters) p.prior = {};
  RecordingsLikelihood likelihood(plain, data);
  const auto of_data = [&](const Eigen::Vector2d& x) {
    return likelihood.evaluate(with_entries(plain.parameters, x), false)->value;
  };
  const auto posterior = [&](const Eigen::Vector2d& x) {
    return of_data(x) - 0.5 * std::pow(std::log(x[0] / 0.5) / std::log(1.5), 2) -
           0.5 * std::pow((x[1] - 3.0) / 0.2, 2);
  };
  const Eigen::Vector2d end(e.parameters[0].value, e.parameters[1].value);
  Eigen::Matrix2d curvature;
  const auto at = [&](double q, double r) { return posterior(end + Eigen::Vector2d(q, r)); };
  constexpr double h = 1e-4;
  EXPECT_NEAR((at(h, 0.0) - at(-h, 0.0)) / (2.0 * h), 0.0, 1e-4);
  EXPECT_NEAR((at(0.0, h) - at(0.0, -h)) / (2.0 * h), 0.0, 1e-4);
  curvature(0, 0) = -(at(h, 0.0) - 2.0 * at(0.0, 0.0) + at(-h, 0.0)) / (h * h);
  curvature(1, 1) = -(at(0.0, h) - 2.0 * at(0.0, 0.0) + at(0.0, -h)) / (h * h);
  curvature(0, 1) = curvature(1, 0) =
      -(at(h, h) - at(h, -h) - at(-h, h) + at(-h, -h)) / (4.0 * h * h);
  const Eigen::Matrix2d covariance = curvature.inverse();
  for (const int i : {0, 1}) {
    EXPECT_NEAR(e.parameters[i].se / std::sqrt(covariance(i, i)), 1.0, 1e-3) << i;
  }
  EXPECT_NEAR(e.objective.log_likelihood, of_data(end), 1e-8);
  EXPECT_NEAR(e.objective.aic, 4.0 - 2.0 * of_data(end), 1e-7);
  EXPECT_NEAR(e.objective.log_likelihood_start, of_data({2.0, 2.0}), 1e-8);
  EXPECT_EQ(e.parameters[0].prior, "log-normal 0.5 within a factor of 1.5");
  EXPECT_THAT(e.notes, testing::Contains(testing::HasSubstr("maximum a posteriori")));
  const NoiseEstimate without = tune_ml(plain, data);
  EXPECT_LT(without.parameters[1].value + 2.0 * without.parameters[1].se, end[1]);
  EXPECT_EQ(without.parameters[0].prior, "");
}

// What the data say nothing about comes out as the prior has it, whatever the start, and a uniform
// prior bounds the search.
TEST(NoiseMl, PriorsDetermineWhatTheDataDoNot) {
  Model model = scalar_model(0.5, 1.0, 0.0);
  Parameter second = model.parameters[1];
  second.name = "second";
  model.parameters.push_back(second);  // R is the sum of both
  as_linear(model).R.entries.push_back({0, 0, 2, 1.0});
  model.parameters[1].prior = {Prior::Kind::log_normal, 0.4, 1.01};
  model.parameters[0].prior = {Prior::Kind::uniform, 0.1, 0.5};
  const std::vector<Dataset> data = {dataset_of(simulate_scalar(0.5, 1.0, 1.0, 2000, 5))};
  const NoiseEstimate e = tune_ml(model, data);
  EXPECT_NEAR(e.parameters[1].value, 0.4, 0.01);
  EXPECT_NEAR(e.parameters[1].se, 0.4 * std::log(1.01), 1e-4);
  EXPECT_EQ(e.identifiability.rank, 2);
  EXPECT_EQ(e.identifiability.of, 2);
  EXPECT_EQ(e.parameters[0].value, 0.5);
  EXPECT_EQ(e.parameters[0].verdict, Verdict::at_bound);
  EXPECT_GT(e.parameters[2].value, 0.3);
}

TEST(NoiseMl, PriorsOfAWholeMatrixAreOfItsVariances) {
  MatiskoSystem system = matisko_system(6);
  Random random(2);
  const std::vector<Dataset> data = {dataset_of(simulate_matisko(system, random))};
  Parameter& R = system.model.parameters[1];
  R.prior = {Prior::Kind::log_normal, 4.0, 1.001};
  for (const Domain domain : {Domain::diagonal, Domain::positive_definite}) {
    R.domain = domain;
    const NoiseEstimate e = tune_ml(system.model, data);
    EXPECT_NEAR(e.noise.R(0, 0), 4.0, 0.05);
    EXPECT_NEAR(e.noise.R(1, 1), 4.0, 0.05);
  }
  R.prior = {Prior::Kind::uniform, 1.0, 2.0};
  EXPECT_THROW(tune_ml(system.model, data), InputError);
}

TEST(NoiseMl, OtherMethodsRefuseAPrior) {
  Model model = scalar_model(0.5, 1.0, 1.0);
  model.parameters[1].prior = {Prior::Kind::log_normal, 0.4, 2.0};
  const std::vector<Dataset> data = {dataset_of(simulate_scalar(0.5, 1.0, 1.0, 500, 5))};
  try {
    tune_als(model, data);
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("the prior of 'r'"));
  }
}

// A sensor that stands still for most of a recording, as wheels do: the same number for hundreds of
// samples, beside which every other sample is large.
TEST(RejectOutliers, StandstillIsNoScale) {
  constexpr int kStill = 700, kSamples = 1000;
  const Model model = scalar_model(0.999, 0.01, 0.1);
  const auto tuned = [&](const MatrixXd& y) {
    return tune_robust(model, {dataset_of(y)},
                       [&](const std::vector<Dataset>& data) { return tune_ml(model, data); });
  };
  MatrixXd y = MatrixXd::Constant(1, kSamples, 0.03);
  y.rightCols(kSamples - kStill) = simulate_scalar(0.999, 0.01, 0.1, kSamples - kStill, 8);
  const NoiseEstimate e = tuned(y);
  for (const Finding& f : e.findings) EXPECT_NE(f.code, FindingCode::outliers_left_out) << f.text;
  EXPECT_GT(e.parameters[1].value, 0.01);
  // Three that are outliers are still found.
  for (const int t : {750, 820, 930}) y(0, t) += 20.0;
  const NoiseEstimate three = tuned(y);
  const auto left =
      std::find_if(three.findings.begin(), three.findings.end(),
                   [](const Finding& f) { return f.code == FindingCode::outliers_left_out; });
  ASSERT_NE(left, three.findings.end());
  EXPECT_THAT(left->text, testing::StartsWith("3 samples left out"));
}

TEST(RejectOutliers, MoreThanATenthAreNone) {
  MatrixXd y = simulate_scalar(0.5, 1.0, 1.0, 1000, 8);
  Random random(9);
  for (double& value : y.reshaped()) {
    if (random.uniform() < 0.2) value += 40.0 * random.normal();
  }
  const Model model = scalar_model(0.5, 1.0, 1.0);
  const std::vector<Dataset> data = {dataset_of(y)};
  const auto estimator = [&](const std::vector<Dataset>& from) { return tune_ml(model, from); };
  const NoiseEstimate e = tune_robust(model, data, estimator);
  EXPECT_EQ(e.status, Status::untrusted);
  const auto many = std::find_if(e.findings.begin(), e.findings.end(), [](const Finding& f) {
    return f.code == FindingCode::too_many_outliers;
  });
  ASSERT_NE(many, e.findings.end());
  EXPECT_THAT(many->text, testing::HasSubstr("none was left out"));
  EXPECT_EQ(e.objective.samples, 1000);
}

}  // namespace
}  // namespace identikal
