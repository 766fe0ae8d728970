// Maximum likelihood of Q and R against published digits and against the Cramér-Rao bound.
#include "identify/noise/ml.h"

#include <cmath>
#include <stdexcept>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "identify/model/model_file.h"
#include "lib/base/random.h"
#include "lib/data/csv.h"
#include "lib/filter/kalman.h"
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
    ASSERT_EQ(e.status, Status::ok);
    const EstimatedParameter& r = e.parameters[1];
    if (r.verdict != Verdict::at_bound) continue;
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

}  // namespace
}  // namespace identikal
