// Maximum likelihood of Q and R against published digits and against the Cramér-Rao bound.
#include "identify/noise_ml.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "lib/csv.h"
#include "lib/kalman.h"
#include "lib/random.h"
#include "tests/support/shared_data.h"

namespace identikal {
namespace {

using Eigen::MatrixXd;

std::string in_tree(const std::string& path) {
  return std::string(IDENTIKAL_SOURCE_DIR) + "/" + path;
}

Dataset dataset_of(const MatrixXd& y) {
  Dataset data;
  data.name = "simulated";
  data.dt = 1.0;
  data.y = y;
  data.u.resize(0, y.cols());
  data.time = Eigen::VectorXd::LinSpaced(y.cols(), 0.0, static_cast<double>(y.cols() - 1));
  for (Eigen::Index i = 0; i < y.rows(); ++i)
    data.outputs.push_back({"y" + std::to_string(i + 1), ""});
  return data;
}

// A scalar model x+ = a x + w, y = x + v with Q and R free.
ModelFile scalar_model(double a, double q, double r) {
  ModelFile model;
  model.name = "scalar";
  Parameter parameter;
  parameter.min = 0.0;
  parameter.name = "q";
  parameter.value = MatrixXd::Constant(1, 1, q);
  model.parameters.push_back(parameter);
  parameter.name = "r";
  parameter.value = MatrixXd::Constant(1, 1, r);
  model.parameters.push_back(parameter);
  LinearModel& linear = model.linear;
  linear.A.constant = MatrixXd::Constant(1, 1, a);
  linear.B.constant.resize(1, 0);
  linear.C.constant = linear.G.constant = MatrixXd::Identity(1, 1);
  linear.D.constant.resize(1, 0);
  linear.S.constant = linear.Q.constant = linear.R.constant = MatrixXd::Zero(1, 1);
  linear.Q.entries = {{0, 0, 0, 1.0}};
  linear.R.entries = {{0, 0, 1, 1.0}};
  return model;
}

MatrixXd simulate_scalar(double a, double q, double r, int N, std::uint64_t seed) {
  Random random(seed);
  MatrixXd y(1, N);
  double x = std::sqrt(q / (1.0 - a * a)) * random.normal();
  for (int t = 0; t < N; ++t) {
    y(0, t) = x + std::sqrt(r) * random.normal();
    x = a * x + std::sqrt(q) * random.normal();
  }
  return y;
}

TEST(NoiseMl, NileWithGaps) {
  // Durbin & Koopman (2012), section 2.7: years 21-40 and 61-80 missing. Maximum recomputed with
  // KFAS.
  const ModelFile model = read_model_file(in_tree("examples/nile.yaml"));
  Dataset data =
      make_dataset(read_csv(in_tree("data/nile.csv")), model.time, model.inputs, model.outputs);
  data.y.middleCols(20, 20).setConstant(std::nan(""));
  data.y.middleCols(60, 20).setConstant(std::nan(""));
  const Estimate e = tune_ml(model, data);
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
    ModelFile model = file ? read_model_file(in_tree(c.model)) : scalar_model(0.5, 1.0, 1.0);
    if (!file) model.outputs = {{"y", "1", "", "", {}}}, model.time.step = 1.0;
    const Dataset data =
        make_dataset(read_csv(shared_file(c.file)), model.time, model.inputs, model.outputs);
    const Eigen::VectorXd truth = Eigen::Map<const Eigen::VectorXd>(
        c.truth.data(), static_cast<Eigen::Index>(c.truth.size()));
    const Likelihood at_truth =
        log_likelihood(instantiate(model.linear, with_coordinates(model.parameters, truth)),
                       InitialState::stationary, data.y, data.u);
    std::printf("%s: at the truth %.10f\n", c.file, at_truth.value);
    EXPECT_NEAR(at_truth.value, c.at_truth, 1e-6);
    const Estimate e = tune_ml(model, data);
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

TEST(NoiseMl, ReachesTheBoundAndCovers) {
  // 400 simulations of q = r = 1, a = 0.5, N = 1000. The ratio std / bound has a standard error
  // of 3.5 %; 95 % intervals cover within 91.5 and 98.5 % unless three standard errors (1.1 %) are
  // exceeded.
  const int runs = 400;
  Eigen::VectorXd q(runs), bound(runs);
  int covered = 0;
  NoiseMlOptions options;
  options.starts = 1;
  for (int run = 0; run < runs; ++run) {
    const Estimate e = tune_ml(
        scalar_model(0.5, 3.0, 0.2),
        dataset_of(simulate_scalar(0.5, 1.0, 1.0, 1000, static_cast<std::uint64_t>(run) + 1)),
        options);
    ASSERT_EQ(e.status, Status::ok) << run;
    q[run] = e.parameters[0].value;
    bound[run] = e.parameters[0].crb_se;
    covered += e.parameters[0].ci95[0] <= 1.0 && 1.0 <= e.parameters[0].ci95[1];
  }
  const double mean = q.mean(), sd = std::sqrt((q.array() - mean).square().sum() / (runs - 1));
  std::printf("q: mean %.4f, std %.4f, std / bound %.3f, coverage %.1f %%\n", mean, sd,
              sd / 0.14048, 100.0 * covered / runs);
  EXPECT_NEAR(mean, 1.0, 4.0 * 0.14048 / std::sqrt(runs));
  EXPECT_NEAR(sd / 0.140479, 1.0, 0.12);  // cases.json: 14.0479 %
  EXPECT_NEAR(covered / static_cast<double>(runs), 0.95, 0.035);
}

TEST(NoiseMl, VarianceAtZeroGetsAnUpperLimitAndNoInterval) {
  // No measurement noise in the data: in about half of the records the maximum lies at r = 0.
  for (std::uint64_t seed = 1; seed < 20; ++seed) {
    const Estimate e =
        tune_ml(scalar_model(0.9, 1.0, 1.0), dataset_of(simulate_scalar(0.9, 1.0, 0.0, 400, seed)));
    ASSERT_EQ(e.status, Status::ok);
    const EstimatedParameter& r = e.parameters[1];
    if (r.verdict != Verdict::at_bound) continue;
    EXPECT_EQ(r.value, 0.0);
    EXPECT_TRUE(std::isnan(r.se));
    EXPECT_GT(r.ci95[1], 0.0);
    EXPECT_LT(r.ci95[1], 1.0);
    EXPECT_THAT(e.warnings[0].text, testing::HasSubstr("not distinguishable from 0"));
    return;
  }
  FAIL() << "no record ended at the bound";
}

TEST(NoiseMl, FullCovarianceFindsTheTruth) {
  // System 6 with full Q (and so a Cholesky factor for coordinates), N = 3000.
  ModelFile model = scalar_model(0.5, 1.0, 1.0);
  model.parameters.clear();
  Parameter block;
  block.name = "Q";
  block.domain = Domain::positive_definite;
  block.value = MatrixXd::Identity(2, 2);
  model.parameters.push_back(block);
  block.name = "R";
  model.parameters.push_back(block);
  LinearModel& m = model.linear;
  m.A.constant = (MatrixXd(2, 2) << 0.8, 1, 0, -0.9).finished();
  m.B.constant.resize(2, 0);
  m.C.constant = m.G.constant = MatrixXd::Identity(2, 2);
  m.D.constant.resize(2, 0);
  m.S.constant = MatrixXd::Zero(2, 2);
  m.Q = m.R = {};
  m.Q.block = 0;
  m.R.block = 1;
  const MatrixXd Q = (MatrixXd(2, 2) << 10, 2, 2, 5).finished(),
                 R = (MatrixXd(2, 2) << 1.5, -0.5, -0.5, 3).finished();
  const MatrixXd Lq = semidefinite_factor(Q), Lr = semidefinite_factor(R);
  Random random(11);
  MatrixXd y(2, 3000);
  Eigen::VectorXd x = Eigen::Vector2d::Zero();
  for (int t = -200; t < 3000; ++t) {
    if (t >= 0) y.col(t) = x + Lr * random.normal(2);
    x = (m.A.constant * x + Lq * random.normal(2)).eval();
  }
  const Estimate e = tune_ml(model, dataset_of(y));
  ASSERT_EQ(e.status, Status::ok);
  const double truth[] = {10, 2, 5, 1.5, -0.5, 3};
  for (std::size_t i = 0; i < 6; ++i) {
    EXPECT_LT(std::abs(e.parameters[i].value - truth[i]), 4.0 * e.parameters[i].se)
        << e.parameters[i].name;
    EXPECT_NEAR(e.parameters[i].se / e.parameters[i].crb_se, 1.0, 0.25);
  }
}

TEST(NoiseMl, RefusesInWords) {
  ModelFile model = scalar_model(0.5, 1.0, 1.0);
  EXPECT_THROW(tune_ml(model, dataset_of(MatrixXd::Constant(1, 100, 3.0))), InputError);
  EXPECT_THROW(tune_ml(model, dataset_of(MatrixXd::Random(1, 2))), InputError);
  model.parameters[0].fixed = model.parameters[1].fixed = true;
  EXPECT_THROW(tune_ml(model, dataset_of(MatrixXd::Random(1, 100))), InputError);
  // An unstable A with a stationary start is a value with a sentence, not an exception.
  const Estimate e = tune_ml(scalar_model(1.5, 1.0, 1.0), dataset_of(MatrixXd::Random(1, 100)));
  EXPECT_EQ(e.status, Status::not_converged);
  EXPECT_THAT(e.message, testing::HasSubstr("undefined"));
}

}  // namespace
}  // namespace identikal
