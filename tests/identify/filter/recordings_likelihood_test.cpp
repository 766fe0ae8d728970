// Behind its beginning a likelihood is the conditional one, with its derivatives; where the diffuse
// likelihood rises without limit, it does not.
#include "identify/filter/recordings_likelihood.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "identify/model/builder.h"
#include "identify/model/recording.h"
#include "lib/base/random.h"
#include "lib/filter/kalman.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// A level, and an error that fades: their sum is what is seen.
Model level_with_error(double pole) {
  Model out = linear_model()
                  .A({{1, 0}, {0, 0}})
                  .C({{1, 1}})
                  .process_noise(variances({{"q", 0.2}, {"s", 0.5}}))
                  .measurement_noise(variance("r", 1.0))
                  .diffuse();
  Parameter a;
  a.name = "a";
  a.value = MatrixXd::Constant(1, 1, pole);
  out.parameters.push_back(a);
  as_linear(out).A.entries = {{1, 1, static_cast<int>(out.parameters.size()) - 1, 1.0}};
  return out;
}

std::vector<Dataset> two_recordings(const Model& model) {
  Random random(5);
  std::vector<Dataset> out;
  for (const Index N : {Index{60}, Index{90}}) {
    MatrixXd y(1, N);
    double level = 3.0, error = 0.0;
    for (Index t = 0; t < N; ++t) {
      y(0, t) = level + error + random.normal();
      level += 0.4 * random.normal();
      error = 0.6 * error + 0.7 * random.normal();
    }
    out.push_back(recording(model, y, 1.0));
  }
  return out;
}

// log p(y(3), ... | y(1), y(2)) of all recordings.
double behind_two_samples(const Model& model, const std::vector<Dataset>& recordings) {
  const StateSpace m = instantiate(as_linear(model), model.parameters);
  const InitialState initial = as_linear(model).initial;
  double out = 0.0;
  for (const Dataset& data : recordings) {
    out += log_likelihood(m, initial, data.y, data.u).value -
           log_likelihood(m, initial, data.y.leftCols(2), data.u.leftCols(2)).value;
  }
  return out;
}

TEST(RecordingsLikelihood, BehindItsBeginningItIsConditional) {
  const Model model = level_with_error(0.6);
  const std::vector<Dataset> recordings = two_recordings(model);
  RecordingsLikelihood likelihood(model, recordings);
  likelihood.condition_on_beginning();
  const double behind = behind_two_samples(model, recordings);
  const Likelihood* at = likelihood.evaluate(model.parameters, true);
  ASSERT_NE(at, nullptr);
  EXPECT_NEAR(at->value, behind, 1e-9);
  const VectorXd gradient = at->gradient, entries = free_entries(model.parameters);
  for (Index i = 0; i < entries.size(); ++i) {
    constexpr double kStep = 1e-5;
    VectorXd up = entries, down = entries;
    up[i] += kStep, down[i] -= kStep;
    const double above = likelihood.evaluate(with_entries(model.parameters, up), false)->value;
    const double below = likelihood.evaluate(with_entries(model.parameters, down), false)->value;
    EXPECT_NEAR(gradient[i], (above - below) / (2.0 * kStep), 1e-5 * (1.0 + std::abs(gradient[i])));
  }
}

TEST(RecordingsLikelihood, APoleThatComesToLieOnAnotherGainsNothing) {
  const Model model = level_with_error(0.6);
  const std::vector<Dataset> recordings = two_recordings(model);
  RecordingsLikelihood whole(model, recordings), behind(model, recordings);
  behind.condition_on_beginning();
  const auto gain = [&](RecordingsLikelihood& likelihood) {
    const Model near = level_with_error(0.99), nearer = level_with_error(0.999);
    const double before = likelihood.evaluate(near.parameters, false)->value;
    return likelihood.evaluate(nearer.parameters, false)->value - before;
  };
  EXPECT_GT(gain(whole), 3.0);
  EXPECT_LT(gain(behind), 0.0);
}

// A level that starts diffuse and a known error that fades, seen by a free gain; the third state stationary.
Model partly_diffuse(bool free_gain) {
  Model out = linear_model()
                  .A({{1, 0, 0}, {0, 0.5, 0}, {0, 0, 0}})
                  .C({{1, 0, 1}})
                  .process_noise(variances({{"q", 0.2}, {"s", 0.5}, {"w", 0.3}}))
                  .measurement_noise(variance("r", 1.0))
                  .diffuse();
  LinearModel& linear = as_linear(out);
  linear.initial = InitialState::partly_diffuse;
  linear.stationary = {2};
  for (const char* name : {"phi", "gain"}) {
    Parameter p;
    p.name = name;
    p.value = MatrixXd::Constant(1, 1, 0.6);
    p.fixed = name[0] == 'g' && !free_gain;
    out.parameters.push_back(p);
  }
  const int last = static_cast<int>(out.parameters.size()) - 1;
  linear.A.entries = {{2, 2, last - 1, 1.0}};
  linear.C.entries = {{0, 1, last, 1.0}};
  return out;
}

TEST(RecordingsLikelihood, OfAPartlyDiffuseStartItIsConditionalWhereItsStatesMoveByFreeParameters) {
  const Model model = partly_diffuse(true);
  const std::vector<Dataset> recordings = two_recordings(model);
  RecordingsLikelihood likelihood(model, recordings);
  likelihood.condition_on_beginning();
  const double behind = behind_two_samples(model, recordings);
  EXPECT_NEAR(likelihood.evaluate(model.parameters, false)->value, behind, 1e-9);
  // The stationary state's alone is no reason.
  const Model other = partly_diffuse(false);
  RecordingsLikelihood whole(other, recordings);
  const double before = whole.evaluate(other.parameters, false)->value;
  whole.condition_on_beginning();
  EXPECT_EQ(whole.evaluate(other.parameters, false)->value, before);
}

TEST(RecordingsLikelihood, OfKnownDynamicsItStays) {
  Model model = level_with_error(0.6);
  model.parameters.back().fixed = true;
  const std::vector<Dataset> recordings = two_recordings(model);
  RecordingsLikelihood likelihood(model, recordings);
  const double before = likelihood.evaluate(model.parameters, false)->value;
  likelihood.condition_on_beginning();
  EXPECT_EQ(likelihood.evaluate(model.parameters, false)->value, before);
  EXPECT_EQ(likelihood.log_likelihood_of_beginning(model.parameters), 0.0);
}

// What was asked for last is not evaluated again; nothing that is asked for in between changes it.
TEST(RecordingsLikelihood, AskedAgainItSaysTheSame) {
  const Model model = level_with_error(0.6);
  const std::vector<Dataset> recordings = two_recordings(model);
  RecordingsLikelihood likelihood(model, recordings), fresh(model, recordings);
  const double before = likelihood.evaluate(model.parameters, false)->value;
  const Likelihood first = *likelihood.evaluate(model.parameters, true);
  EXPECT_NEAR(first.value, before, 1e-12 * std::abs(before));
  EXPECT_EQ(first.gradient.size(), 4);
  EXPECT_EQ(likelihood.evaluate(model.parameters, true)->gradient, first.gradient);
  likelihood.score_products(model.parameters);
  EXPECT_EQ(likelihood.evaluate(model.parameters, true)->gradient, first.gradient);
  int shown = 0;
  likelihood.watch(model.parameters, true, 0, [&](const FilteredState&) { ++shown; });
  EXPECT_EQ(shown, recordings[0].size() - 2);  // two are taken by the diffuse start
  EXPECT_EQ(likelihood.evaluate(model.parameters, true)->gradient, first.gradient);
  ParameterSet other = model.parameters;
  other[1].value *= 1.5;
  const Likelihood there = *likelihood.evaluate(other, true);
  EXPECT_EQ(there.gradient, fresh.evaluate(other, true)->gradient);
  likelihood.condition_on_beginning();
  fresh.condition_on_beginning();
  EXPECT_EQ(likelihood.evaluate(other, true)->value, fresh.evaluate(other, true)->value);
  EXPECT_NE(likelihood.evaluate(other, true)->value, there.value);
}

}  // namespace
}  // namespace identikal
