// The filter that takes one sample at a time is the filter of the whole recording.
#include "lib/filter/online_filter.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "lib/base/constants.h"
#include "lib/filter/kalman.h"
#include "lib/filter/smoother.h"
#include "tests/support/random_model.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

struct Case {
  Index states, inputs, outputs;
  InitialState initial;
  double missing;  // share of the samples
};

// Largest difference, in the recorded one's standard deviations; NaN has to meet NaN.
double difference(const VectorXd& ours, const VectorXd& theirs, const VectorXd& sd) {
  double largest = 0.0;
  for (Index i = 0; i < ours.size(); ++i) {
    if (std::isnan(ours[i]) && std::isnan(theirs[i])) continue;
    const double d = std::abs(ours[i] - theirs[i]) / (std::abs(theirs[i]) + sd[i]);
    largest = d <= largest ? largest : d;  // a NaN stays
    if (std::isnan(d)) return d;
  }
  return largest;
}

TEST(OnlineFilter, IsTheRecordedFilter) {
  for (const Case& c :
       {Case{1, 0, 1, InitialState::stationary, 0.0}, Case{3, 1, 2, InitialState::stationary, 0.2},
        Case{2, 2, 1, InitialState::diffuse, 0.0}, Case{4, 1, 3, InitialState::diffuse, 0.3},
        Case{5, 0, 2, InitialState::given, 0.1}}) {
    Random random(static_cast<std::uint64_t>(100 * c.states + c.outputs));
    StateSpace model = random_model(random, c.states, c.inputs, c.outputs, c.states);
    model.x0 = VectorXd::Constant(c.states, 0.5);
    model.P0 = 2.0 * MatrixXd::Identity(c.states, c.states);
    const Index N = 300;
    MatrixXd u(c.inputs, N);
    for (Index t = 0; t < N; ++t) u.col(t) = random.normal(c.inputs);
    MatrixXd y = simulate_outputs(random, model, u, N);
    for (double& value : y.reshaped()) {
      if (random.uniform() < c.missing) value = kNaN;
    }
    const SmootherResult recorded = smooth_with_lag(model, c.initial, y, u, 0);
    const FilterResult innovations = kalman_filter(model, c.initial, y, u);
    OnlineFilter filter = start_online_filter(model, c.initial);
    double states = 0.0, deviations = 0.0, errors = 0.0;
    for (Index t = 0; t < N; ++t) {
      ASSERT_TRUE(step(filter, y.col(t), u.col(t)));
      states = std::max(states, difference(filter.state, recorded.x.col(t), recorded.sd.col(t)));
      deviations = std::max(
          deviations, difference(filter.state_sd, recorded.sd.col(t), VectorXd::Zero(c.states)));
      if (t < innovations.first_proper) continue;
      errors = std::max(errors,
                        difference(filter.innovation, innovations.e.col(t), filter.innovation_sd));
    }
    EXPECT_LT(states, 1e-12) << c.states << " states";
    EXPECT_LT(deviations, 1e-12) << c.states << " states";
    EXPECT_LT(errors, 1e-12) << c.states << " states";
  }
}

TEST(OnlineFilter, RefusesWhatDoesNotFit) {
  Random random(1);
  const StateSpace model = random_model(random, 2, 1, 1, 2);
  OnlineFilter filter = start_online_filter(model, InitialState::diffuse);
  EXPECT_THROW(step(filter, VectorXd::Zero(2), VectorXd::Zero(1)), std::invalid_argument);
  EXPECT_THROW(step(filter, VectorXd::Zero(1), VectorXd::Zero(0)), std::invalid_argument);
  EXPECT_FALSE(step(filter, VectorXd::Zero(1), VectorXd::Constant(1, kNaN)));
  StateSpace unstable = model;
  unstable.A = 2.0 * MatrixXd::Identity(2, 2);
  EXPECT_THROW(start_online_filter(unstable, InitialState::stationary), std::invalid_argument);
}

}  // namespace
}  // namespace identikal
