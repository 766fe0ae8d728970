#include "identify/optimality/optimality.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "identify/optimality/check.h"
#include "identify/optimality/compare_filters.h"
#include "lib/base/error.h"
#include "lib/filter/steady_state.h"
#include "tests/support/matisko_example_1.h"
#include "tests/support/optimality_case.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using ::testing::HasSubstr;
using ::testing::Not;

// y = v, v of variance R: nothing but a variance to be wrong about.
StateSpace white_system(double R) {
  StateSpace m;
  m.A = m.Q = m.S = MatrixXd::Zero(1, 1);
  m.G = m.C = MatrixXd::Ones(1, 1);
  m.B.resize(1, 0);
  m.D.resize(1, 0);
  m.R = MatrixXd::Constant(1, 1, R);
  return m;
}

Model free_R(double R) {
  Model model = fixed_model(white_system(R));
  Parameter p;
  p.name = "r";
  p.value = as_linear(model).R.constant;
  p.min = 0.0;
  model.parameters.push_back(p);
  as_linear(model).R = {};
  as_linear(model).R.constant = MatrixXd::Zero(1, 1);
  as_linear(model).R.entries.push_back({0, 0, 0, 1.0});
  return model;
}

const TestResult* find(const std::vector<TestResult>& tests, const std::string& id) {
  for (const TestResult& t : tests) {
    if (t.id == id) return &t;
  }
  return nullptr;
}

// The score of a variance is N (s^2 / R - 1) / (2 R), its information N / (2 R^2): one step leads
// to the mean square exactly.
TEST(ScoreStatistic, OfOneVarianceIsExact) {
  Random random(1);
  const Dataset data = recording_of(white_system(2.0), 400, random);
  const double s2 = data.y.squaredNorm() / 400.0, R = 3.0;
  const ScoreStatistic out = score_statistic(with_free_noise(free_R(R)), {data});
  ASSERT_EQ(out.names, std::vector<std::string>{"r"});
  EXPECT_NEAR(R + out.step[0], s2, 1e-10);
  EXPECT_NEAR(out.step_se[0], R * std::sqrt(2.0 / 400.0), 1e-10);
  EXPECT_NEAR(out.direction[0], (s2 / R - 1.0) * std::sqrt(200.0), 1e-10);
  EXPECT_NEAR(out.statistic.value, out.direction[0] * out.direction[0], 1e-9);
  EXPECT_EQ(out.statistic.dof, 1.0);
}

TEST(ScoreStatistic, WhatTheFileLeavesFreeElseAllOfQAndR) {
  EXPECT_EQ(coordinates(with_free_noise(free_R(1.0)).parameters).size(), 1);
  const Model all = with_free_noise(fixed_model(matisko_example_1()));
  EXPECT_EQ(reported_entries(all.parameters).names,
            (std::vector<std::string>{"Q(1,1)", "Q(2,1)", "Q(2,2)", "R(1,1)"}));
}

// Two sensors that take turns: each has samples on every second row, and neither has one on the row
// before its own.
TEST(Optimality, SensorsThatTakeTurnsHaveLagsOfTheirOwn) {
  StateSpace m = matisko_example_1();
  m.A = MatrixXd::Constant(1, 1, 0.9);
  m.G = m.Q = MatrixXd::Ones(1, 1);
  m.B.resize(1, 0);
  m.C = MatrixXd::Ones(2, 1);
  m.D.resize(2, 0);
  m.S = MatrixXd::Zero(1, 2);
  m.R = MatrixXd::Identity(2, 2);
  Random random(3);
  Dataset data = recording_of(m, 2000, random);
  for (Index t = 0; t < data.size(); ++t) data.y(t % 2, t) = std::nan("");
  m.Q *= 0.01;  // innovations are then correlated for many samples
  const OptimalityReport wrong = check(fixed_model(m), {data});
  EXPECT_EQ(wrong.status, Status::rejected);
  for (const Finding& f : wrong.findings) EXPECT_THAT(f.text, Not(HasSubstr("nan"))) << f.text;
  EXPECT_THAT(wrong.message, Not(HasSubstr("nan")));
  const TestResult* white = find(wrong.tests, "ljung_box");
  ASSERT_NE(white, nullptr);
  EXPECT_FALSE(white->pass);
  m.Q *= 100.0;
  EXPECT_EQ(check(fixed_model(m), {data}).status, Status::ok);
}

// What no recording tells leaves the degrees of freedom: Q and R of y = w + v.
TEST(ScoreStatistic, FlatDirectionsAreNotCounted) {
  Random random(2);
  StateSpace m = white_system(1.0);
  m.Q = MatrixXd::Ones(1, 1);
  const Dataset data = recording_of(m, 300, random);
  const ScoreStatistic out = score_statistic(with_free_noise(fixed_model(m)), {data});
  EXPECT_EQ(out.statistic.dof, 1.0);
  EXPECT_TRUE(std::isnan(out.step_se[0]));
}

TEST(Optimality, LevelsMakeFivePercent) {
  Random random(3);
  StateSpace truth = matisko_example_1();
  const Model model = fixed_model(truth);
  const Dataset data = recording_of(truth, 500, random);
  const Optimality out = test_optimality(model, {data}, {innovations_of(model, data)});
  double sum = 0.0;
  for (const TestResult& t : out.tests) sum += std::isnan(t.level) ? 0.0 : t.level;
  EXPECT_NEAR(sum, 0.05, 1e-12);
  EXPECT_TRUE(out.optimal);
  EXPECT_LT(retuned(with_free_noise(model), {data}).loss, 0.05);
  for (const char* id : {"score", "portmanteau", "nis", "ljung_box", "mean", "score_entry",
                         "ar_order", "normality", "mcleod_li"}) {
    EXPECT_NE(find(out.tests, id), nullptr) << id;
  }
}

TEST(Optimality, SaysWhichEntryAndWhichWay) {
  Random random(4);
  const StateSpace truth = matisko_example_1();
  StateSpace wrong = truth;
  wrong.Q(0, 0) = 1.0;
  const OptimalityReport out = check(fixed_model(wrong), {recording_of(truth, 500, random)});
  EXPECT_EQ(out.status, Status::rejected);
  EXPECT_THAT(out.message, HasSubstr("Q(1,1) should be larger"));
  EXPECT_THAT(out.message, HasSubstr("times as large (in variance)"));
  ASSERT_EQ(out.derived.size(), 1u);
  // What the present gain costs in truth.
  const double K_loss = [&] {
    const auto now = steady_state(wrong), best = steady_state(truth);
    const MatrixXd F = truth.A - now->K * truth.C;
    const auto P = solve_discrete_lyapunov(
        F, truth.G * truth.Q * truth.G.transpose() + now->K * truth.R * now->K.transpose());
    return 100.0 * (P->trace() / best->P.trace() - 1.0);
  }();
  std::printf("predicted loss %.1f %%, in truth %.1f %%\n", out.derived[0].value, K_loss);
  EXPECT_GT(out.derived[0].value, 0.5 * K_loss);
  EXPECT_LT(out.derived[0].value, 2.0 * K_loss);
}

TEST(Optimality, SaysWhichChannelFollowsWhichInput) {
  Random random(5);
  StateSpace truth = white_system(1.0);
  truth.Q = 0.5 * MatrixXd::Ones(1, 1);
  truth.A(0, 0) = 0.8;
  truth.B = MatrixXd::Ones(1, 1);
  truth.D = MatrixXd::Zero(1, 1);
  StateSpace wrong = truth;
  wrong.D(0, 0) = 0.5;
  const Dataset data = recording_of(truth, 400, random);
  const OptimalityReport out = check(fixed_model(wrong), {data});
  EXPECT_EQ(out.status, Status::rejected);
  EXPECT_THAT(out.message, HasSubstr("innovations of 'y1' follow the inputs"));
  Dataset offset = data;
  offset.y.array() += 1.0;
  EXPECT_THAT(check(fixed_model(truth), {offset}).message, HasSubstr("have a mean of"));
}

TEST(Optimality, NothingIsSaidOfNothing) {
  Random random(6);
  const Model model = fixed_model(matisko_example_1());
  const Dataset good = recording_of(matisko_example_1(), 100, random);
  Dataset constant = good, missing = good, brief = good;
  constant.y.setConstant(3.0);
  missing.y.setConstant(std::nan(""));
  brief.y = good.y.leftCols(10).eval();
  brief.u = good.u.leftCols(10).eval();
  brief.time = good.time.head(10).eval();
  for (const Dataset& data : {constant, missing, brief}) {
    EXPECT_THROW(check(model, {data}), InputError);
  }
  // Every other sample missing: fewer tests, but an answer.
  Dataset ridden = recording_of(matisko_example_1(), 400, random);
  for (Index t = 0; t < 400; t += 2) ridden.y(0, t) = std::nan("");
  EXPECT_EQ(check(model, {ridden}).status, Status::ok);
}

TEST(Compare, RanksByLikelihood) {
  Random random(7);
  const Dataset data = recording_of(matisko_example_1(), 1000, random);
  std::vector<Model> models;
  for (const int tuning : {1, 0, 2}) {
    models.push_back(fixed_model(matisko_example_1_tuning(tuning)));
    models.back().source = std::to_string(tuning) + ".yaml";
  }
  const Comparison out = compare_filters(models, {{data}, {data}, {data}});
  EXPECT_EQ(out.tests[0].channel, "0.yaml");
  EXPECT_TRUE(out.tests[0].pass);
  EXPECT_THAT(out.message, HasSubstr("0.yaml has the highest likelihood"));
  for (const std::string& note : out.notes) std::printf("%s\n", note.c_str());
  EXPECT_THROW(compare_filters({models[0]}, {{data}}), InputError);
  models[1].outputs[0].column = "other";
  EXPECT_THROW(compare_filters(models, {{data}, {data}, {data}}), InputError);
}

}  // namespace
}  // namespace identikal
