// Posteriors of noise covariances: two independent ways to the same answer, and honest intervals.
#include "identify/noise/bayes.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <map>
#include <vector>

#include <gtest/gtest.h>

#include "lib/base/error.h"
#include "tests/support/matisko_systems.h"
#include "tests/support/scalar_case.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

MatiskoSystem with_prior(MatiskoSystem system, const Prior& prior) {
  for (Parameter& p : system.model.parameters) p.prior = prior;
  return system;
}

// Largest distance between the distribution functions of a grid and of draws, at the edges of the
// grid's cells.
double kolmogorov_distance(const PosteriorPoints& grid, const PosteriorPoints& drawn, Index entry) {
  std::map<double, double> mass;  // of the grid's values
  for (Index i = 0; i < grid.weight.size(); ++i) mass[grid.entries(entry, i)] += grid.weight[i];
  double sum = 0.0, worst = 0.0;
  for (auto cell = mass.begin(); std::next(cell) != mass.end(); ++cell) {
    sum += cell->second;
    const double edge = std::sqrt(cell->first * std::next(cell)->first);
    const auto below = (drawn.entries.row(entry).array() <= edge).count();
    worst = std::max(worst, std::abs(sum - static_cast<double>(below) /
                                               static_cast<double>(drawn.weight.size())));
  }
  return worst;
}

TEST(NoiseBayes, GridAndMonteCarloAgree) {
  // System 1 with the prior of the source's grid.
  const MatiskoSystem system =
      with_prior(matisko_system(1), {Prior::Kind::log_uniform, 0.01, 15.0});
  Random random(1);
  const std::vector<Dataset> data = {dataset_of(simulate_matisko(system, random))};
  NoiseBayesOptions options;
  options.draws = 4000;
  const PosteriorPoints grid = posterior(system.model, data, options);
  options.grid = false;
  const PosteriorPoints drawn = posterior(system.model, data, options);
  ASSERT_TRUE(grid.summary.usable() && drawn.summary.usable());
  for (Index i = 0; i < 2; ++i) {
    const double distance = kolmogorov_distance(grid, drawn, i);
    std::printf("%s: Kolmogorov distance of grid and 4000 draws %.4f\n", i == 0 ? "Q" : "R",
                distance);
    EXPECT_LT(distance, 0.03);
  }
  std::printf("log evidence: grid %.3f, draws %.3f\n", grid.log_evidence, drawn.log_evidence);
  EXPECT_NEAR(grid.log_evidence, drawn.log_evidence, 0.2);
}

TEST(NoiseBayes, FullCovariancesStayDefiniteAndFindTheTruth) {
  MatiskoSystem system = matisko_system(6);
  for (Parameter& p : system.model.parameters) p.domain = Domain::positive_definite;
  Random random(2);
  const NoiseEstimate e =
      tune_bayes(system.model, {dataset_of(simulate_matisko(matisko_system(6), random))});
  ASSERT_EQ(e.status, Status::ok);
  const double truth[] = {10, 0, 5, 1.5, 0, 3};
  for (std::size_t i = 0; i < 6; ++i) {
    EXPECT_LT(std::abs(e.parameters[i].value - truth[i]), 4.0 * e.parameters[i].se)
        << e.parameters[i].name;
  }
  EXPECT_GT(e.posterior->effective, 1500.0);
}

TEST(NoiseBayes, SaysWhatOnlyThePriorKnows) {
  // Two noises into one output: of their shares nothing is known but their sum.
  MatiskoSystem system = matisko_system(1);
  LinearModel& m = as_linear(system.model);
  const MatiskoSystem truth = matisko_system(1);
  m.Q.block = -1;
  m.R.block = -1;
  m.Q.constant = Eigen::MatrixXd::Zero(1, 1);
  m.R.constant = Eigen::MatrixXd::Zero(1, 1);
  system.model.parameters.clear();
  for (const char* name : {"q", "r", "unseen"}) {
    Parameter p;
    p.name = name;
    p.value = Eigen::MatrixXd::Ones(1, 1);
    p.min = 0.0;
    system.model.parameters.push_back(p);
  }
  m.Q.entries = {{0, 0, 0, 1.0}, {0, 0, 2, 1e-9}};
  m.R.entries = {{0, 0, 1, 1.0}};
  Random random(3);
  const NoiseEstimate e = tune_bayes(system.model, {dataset_of(simulate_matisko(truth, random))});
  EXPECT_EQ(e.status, Status::rejected);
  EXPECT_EQ(e.parameters[2].verdict, Verdict::not_identifiable);
  EXPECT_EQ(e.identifiability.rank, 2);
  // A number that is no variance needs a prior or bounds.
  system.model.parameters[2].min = -1.0;
  EXPECT_THROW(tune_bayes(system.model, {dataset_of(simulate_matisko(truth, random))}), InputError);
}

}  // namespace
}  // namespace identikal
