// Cramer-Rao bounds before any data, against published ones.
#include "identify/optimality/bound.h"

#include <cmath>
#include <cstdio>
#include <fstream>
#include <limits>
#include <string>

#include <Eigen/LU>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "identify/model/builder.h"
#include "identify/model/model_file.h"
#include "lib/base/error.h"
#include "lib/filter/information.h"
#include "lib/filter/steady_state.h"
#include "tests/support/matisko_systems.h"
#include "tests/support/shared_data.h"

namespace identikal {
namespace {

using Eigen::Index;

Model true_model(const MatiskoSystem& system, Domain domain) {
  Model model = system.model;
  model.parameters = with_entries(model.parameters, system.truth);
  for (Parameter& p : model.parameters) p.domain = domain;
  return model;
}

const EstimatedParameter& named(const Estimate& estimate, const std::string& name) {
  for (const EstimatedParameter& p : estimate.parameters) {
    if (p.name == name) return p;
  }
  throw std::logic_error("no parameter " + name);
}

TEST(BoundOf, EqualsTheReferenceToFourDigits) {
  IDENTIKAL_NEEDS_SHARED_FILE("noise/crb.json");
  const auto reference = nlohmann::json::parse(std::ifstream(shared_file("noise/crb.json")));
  // The reference is asymptotic; so is a very long recording.
  constexpr Index kLong = 1000000000;
  double worst = 0.0, finite = 0.0;
  for (const auto& [key, number, domain] :
       {std::tuple{"sys1", 1, Domain::diagonal}, std::tuple{"sys5", 5, Domain::diagonal},
        std::tuple{"sys6", 6, Domain::diagonal}, std::tuple{"sys7", 7, Domain::diagonal},
        std::tuple{"sys6_full", 6, Domain::positive_definite},
        std::tuple{"sys7_full", 7, Domain::positive_definite}}) {
    const MatiskoSystem system = matisko_system(number);
    BoundOptions options;
    options.samples = kLong;
    const CramerRaoBound estimate = bound_of(true_model(system, domain), options, nullptr);
    options.samples = system.samples;
    const CramerRaoBound planned = bound_of(true_model(system, domain), options, nullptr);
    const double longer = static_cast<double>(kLong) / static_cast<double>(system.samples);
    ASSERT_EQ(estimate.status, Status::ok) << key;
    for (const auto& [entry, value] : reference.at(key).items()) {
      // "Q12" there is Q(2,1) here.
      const std::string name = std::string(1, entry[0]) + "(" + entry[2] + "," + entry[1] + ")";
      const double expected = value.at("std").get<double>();
      const double actual = named(estimate, name).crb_se * std::sqrt(longer);
      worst = std::max(worst, std::abs(actual / expected - 1.0));
      finite = std::max(finite, std::abs(named(planned, name).crb_se / expected - 1.0));
    }
  }
  std::printf("bounds of crb.json: %.1e apart, %.1e for the finite recording\n", worst, finite);
  EXPECT_LT(worst, 5e-5);
  EXPECT_LT(finite, 2e-3);
}

TEST(BoundOf, AccuracyIsInvertedAndSystem1SaysWhatItNeeds) {
  const Model model = true_model(matisko_system(1), Domain::diagonal);
  BoundOptions options;
  options.samples = 1000;
  options.accuracy = 0.1;
  const CramerRaoBound estimate = bound_of(model, options, nullptr);
  const EstimatedParameter& R = named(estimate, "R(1,1)");
  const double needed = estimate.bound.parameters[1].samples_needed;
  std::printf("System 1: R %.1f %% at N = 1000, %.0f samples for 10 %%\n", 100.0 * R.crb_se,
              needed);
  EXPECT_NEAR(100.0 * R.crb_se, 71.1, 0.05);
  options.samples = static_cast<Index>(needed);
  EXPECT_NEAR(named(bound_of(model, options, nullptr), "R(1,1)").crb_se, 0.1, 1e-4);
  // 2 Q^2 / t and 2 R^2 / t of the source, chapter 6.
  EXPECT_NEAR(estimate.bound.parameters[0].complete_se, 10.0 * std::sqrt(2.0 / 1000.0), 1e-12);
  EXPECT_NEAR(estimate.bound.parameters[1].complete_se, 1.0 * std::sqrt(2.0 / 1000.0), 1e-12);
}

// A level whose start is known settles slowly: the first samples say less of q than later ones.
TEST(BoundOf, TheSamplesNeededAreExactWhereTheFilterHasToSettle) {
  const Model model = linear_model()
                          .A(1)
                          .C(1)
                          .process_noise(variance("q", 1.0))
                          .measurement_noise(variance("r", 100.0))
                          .initial(Eigen::VectorXd::Zero(1), Eigen::MatrixXd::Zero(1, 1));
  BoundOptions options;
  options.samples = 20;  // shorter than it takes to settle
  options.accuracy = 0.25;
  const CramerRaoBound planned = bound_of(model, options, nullptr);
  for (const auto& [name, entry] : {std::pair{"q", 0}, {"r", 1}}) {
    const double needed = planned.bound.parameters[entry].samples_needed;
    const double wanted = 0.25 * named(planned, name).value;
    options.samples = static_cast<Index>(needed);
    EXPECT_LE(named(bound_of(model, options, nullptr), name).crb_se, wanted * (1.0 + 1e-9));
    options.samples -= 1;
    EXPECT_GT(named(bound_of(model, options, nullptr), name).crb_se, wanted * (1.0 - 1e-9)) << name;
    std::printf("%s: %.0f samples\n", name, needed);
  }
}

// x' = -k x + w, density q, every 0.1 s: with x observed a variance is known to q sqrt(2 / N), and
// nothing is said of k, which the sampled noise depends on too.
TEST(BoundOf, KnownStatesSayOfContinuousNoiseWhatTheySayOfSampledNoise) {
  Model model;
  model.source = "decay.yaml";
  for (const auto& [name, value] : {std::pair{"k", 2.0}, {"q", 3.0}, {"r", 0.1}}) {
    Parameter p;
    p.name = name;
    p.value = Eigen::MatrixXd::Constant(1, 1, value);
    model.parameters.push_back(p);
  }
  LinearModel& linear = as_linear(model);
  const Eigen::MatrixXd one = Eigen::MatrixXd::Ones(1, 1), zero = Eigen::MatrixXd::Zero(1, 1);
  for (ParametrisedMatrix* M : {&linear.A, &linear.Q, &linear.R, &linear.S}) M->constant = zero;
  linear.B.constant = Eigen::MatrixXd::Zero(1, 0);
  linear.D.constant = Eigen::MatrixXd::Zero(1, 0);
  linear.C.constant = linear.G.constant = one;
  linear.A.entries = {{0, 0, 0, -1.0}};
  linear.Q.entries = {{0, 0, 1, 1.0}};
  linear.R.entries = {{0, 0, 2, 1.0}};
  linear.continuous = true;
  linear.noise = ProcessNoise::density;
  linear.dt = 0.1;
  linear.initial = InitialState::stationary;
  BoundOptions options;
  options.samples = 1000;
  const CramerRaoBound estimate = bound_of(model, options, nullptr);
  const std::vector<Bound::Parameter>& bound = estimate.bound.parameters;
  EXPECT_TRUE(std::isnan(bound[0].complete_se));
  EXPECT_NEAR(bound[1].complete_se, 3.0 * std::sqrt(2.0 / 1000.0), 1e-12);
  EXPECT_NEAR(bound[2].complete_se, 0.1 * std::sqrt(2.0 / 1000.0), 1e-12);
  EXPECT_LT(bound[1].complete_se, named(estimate, "q").crb_se);
}

TEST(BoundOf, GainSensitivityIsTheDerivativeOfTheGain) {
  const MatiskoSystem system = matisko_system(7);
  const Model model = true_model(system, Domain::diagonal);
  BoundOptions options;
  options.samples = 3000;
  const CramerRaoBound estimate = bound_of(model, options, nullptr);
  for (Index i = 0; i < system.truth.size(); ++i) {
    Eigen::VectorXd up = system.truth, down = up;
    up[i] *= 1.0 + 1e-5;
    down[i] *= 1.0 - 1e-5;
    const auto gain = [&](const Eigen::VectorXd& at) {
      return steady_state(instantiate(as_linear(model), with_entries(model.parameters, at)))->K;
    };
    const Eigen::MatrixXd change = (gain(up) - gain(down)) * (0.01 / 2e-5);
    EXPECT_LT((estimate.bound.parameters[i].gain_change - change).norm(), 1e-9);
  }
}

// Two unknown variances, one gain and one innovation variance: the bounds are one bound, and
// (6.45), carried over, is below it.
TEST(BoundOf, InnovationFormOfOneStateIsTheSameBound) {
  const MatiskoSystem system = matisko_system(1);
  const Model model = true_model(system, Domain::diagonal);
  BoundOptions options;
  options.samples = 100000;
  const CramerRaoBound estimate = bound_of(model, options, nullptr);
  const Bound::InnovationForm& form = estimate.bound.innovation_form;
  const double k = estimate.noise.K_steady(0, 0), Sigma = form.Sigma(0, 0), N = 100000;
  EXPECT_NEAR(form.K_se(0, 0), std::sqrt((1.0 - std::pow(0.5 - k, 2)) / N), 1e-12);
  EXPECT_NEAR(form.Sigma_se(0, 0), Sigma * std::sqrt(2.0 / N), 1e-12);
  EXPECT_NEAR(form.K_se(0, 0) / estimate.bound.gain_se(0, 0), 1.0, 1e-4);
  EXPECT_NEAR(form.published_K_se, k / std::sqrt(N), 1e-12);
  EXPECT_NEAR(form.published_Sigma_se, form.Sigma_se(0, 0), 1e-12);
  // Differences in place of the derivatives of the Riccati equation.
  const auto filter = [&](double q, double r) {
    const auto s = steady_state(
        instantiate(as_linear(model), with_entries(model.parameters, Eigen::Vector2d(q, r))));
    return Eigen::Vector2d(s->K(0, 0), s->Sigma(0, 0));
  };
  Eigen::Matrix2d T;
  T << (filter(10.001, 1) - filter(9.999, 1)) / 0.002,
      (filter(10, 1.001) - filter(10, 0.999)) / 0.002;
  const auto carried = [&](const Eigen::Matrix2d& covariance) {
    const Eigen::Matrix2d back = T.inverse();
    return Eigen::Vector2d((back * covariance * back.transpose()).diagonal().cwiseSqrt());
  };
  const Eigen::Vector2d bound = carried(
      Eigen::Vector2d(std::pow(form.K_se(0, 0), 2), std::pow(form.Sigma_se(0, 0), 2)).asDiagonal());
  const Eigen::Vector2d published =
      carried(published_innovation_information(k, Sigma).inverse() / N);
  for (Index i = 0; i < 2; ++i) {
    const auto at = static_cast<std::size_t>(i);
    EXPECT_NEAR(bound[i] / estimate.parameters[at].crb_se, 1.0, 1e-4);
    const double published_se = estimate.bound.parameters[at].published_se;
    EXPECT_NEAR(published_se / published[i], 1.0, 1e-5);
    EXPECT_LT(published_se, estimate.parameters[at].crb_se);
    std::printf("System 1, %s: bound %.4g, by (6.45) %.4g\n", estimate.parameters[at].name.c_str(),
                estimate.parameters[at].crb_se, published_se);
  }
}

TEST(BoundOf, InnovationFormOfSeveralStatesAndOutputs) {
  BoundOptions options;
  options.samples = 3000;
  const CramerRaoBound estimate =
      bound_of(true_model(matisko_system(7), Domain::diagonal), options, nullptr);
  const Bound::InnovationForm& form = estimate.bound.innovation_form;
  EXPECT_EQ(form.K_se.rows(), 4);
  EXPECT_EQ(form.K_se.cols(), 2);
  // Five variances make the eight gains: knowing so can only help.
  EXPECT_TRUE((form.K_se.array() >= 0.999 * estimate.bound.gain_se.array()).all());
  EXPECT_TRUE(std::isnan(form.published_K_se));
  for (const Bound::Parameter& p : estimate.bound.parameters) {
    EXPECT_TRUE(std::isnan(p.published_se));
  }
  // A state that no output shows.
  MatiskoSystem hidden = matisko_system(6);
  as_linear(hidden.model).A.constant = Eigen::Vector2d(0.5, 0.4).asDiagonal();
  as_linear(hidden.model).C.constant = Eigen::MatrixXd::Identity(2, 2);
  as_linear(hidden.model).C.constant(1, 1) = 0.0;
  const CramerRaoBound blind = bound_of(true_model(hidden, Domain::diagonal), options, nullptr);
  EXPECT_TRUE(blind.bound.innovation_form.K_se.array().isNaN().all());
  EXPECT_NEAR(blind.bound.innovation_form.Sigma_se(1, 1), 3.0 * std::sqrt(2.0 / 3000.0), 1e-9);
}

// x' = b w - x/tau with w a column, or with w = u^2 by a formula: the same information, whichever way it is read.
TEST(BoundOf, AModelWhoseInputIsAFormulaSaysTheSame) {
  const std::string head =
      "identikal: 1\nstates: [x]\ninputs: [{name: u}]\nparameters: {tau: {value: 3, min: 0.1}, b: "
      "{value: 1}}\n"
      "time: {kind: discrete, step: 1 s}\noutputs: {y: {column: y, equals: x}}\n"
      "noise: {process: {kind: per-sample, sd: {x: 0.2}}, measurement: {sd: {y: 0.1}}}\n"
      "initial: {mean: {x: 0}, sd: {x: 1}}\n";
  const Model column = parse_model_file(head + "dynamics: {x: x - x/tau + b*u}\n", "column.yaml"),
              formula =
                  parse_model_file(head + "dynamics: {x: x - x/tau + b*u^2}\n", "formula.yaml");
  Dataset inputs;
  inputs.time = Eigen::VectorXd::LinSpaced(200, 0.0, 199.0);
  inputs.u = (0.3 * inputs.time).array().sin().matrix().transpose();
  inputs.inputs = {{"u", ""}};
  inputs.outputs = {{"y", ""}};
  inputs.dt = 1.0;
  inputs.y = Eigen::MatrixXd::Constant(1, 200, std::numeric_limits<double>::quiet_NaN());
  Dataset squared = inputs;
  squared.u = inputs.u.cwiseAbs2();
  BoundOptions options;
  options.samples = 200;
  const CramerRaoBound by_column = bound_of(column, options, &squared),
                       by_formula = bound_of(formula, options, &inputs);
  for (const char* name : {"tau", "b"}) {
    const double expected = named(by_column, name).crb_se;
    EXPECT_GT(expected, 0.0);
    // 50 simulated recordings stand for the expectation: their scatter is a few per cent.
    EXPECT_NEAR(named(by_formula, name).crb_se, expected, 0.05 * expected) << name;
  }
}

TEST(BoundOf, WhatNoRecordingDetermines) {
  // Two noises into one output: only their sum shows.
  MatiskoSystem system = matisko_system(1);
  as_linear(system.model).G.constant = Eigen::RowVector2d(1.0, 1.0);
  as_linear(system.model).S.constant = Eigen::MatrixXd::Zero(2, 1);
  system.model.parameters[0].value = Eigen::MatrixXd::Identity(2, 2);
  BoundOptions options;
  options.samples = 1000;
  const CramerRaoBound estimate = bound_of(system.model, options, nullptr);
  EXPECT_EQ(estimate.status, Status::rejected);
  EXPECT_EQ(estimate.identifiability.rank, 2);
  EXPECT_TRUE(std::isnan(named(estimate, "Q(1,1)").crb_se));
  EXPECT_FALSE(std::isnan(named(estimate, "R(1,1)").crb_se));
  for (Parameter& p : system.model.parameters) p.fixed = true;
  EXPECT_THROW(bound_of(system.model, options, nullptr), InputError);
}

}  // namespace
}  // namespace identikal
