// The state that a watcher is shown is the filter's own, and its derivatives are those of
// differences, with missing samples and a diffuse start, linear and not.
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "lib/base/constants.h"
#include "lib/base/random.h"
#include "lib/filter/kalman.h"
#include "lib/nonlinear/filter.h"
#include "tests/support/random_model.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// A mass that drifts, seen by two sensors; theta = (damping, gain of C, Q, R(1,1)).
StateSpace drifting_mass(const Eigen::Vector4d& theta) {
  StateSpace m;
  m.A = MatrixXd{{1.0, 0.1}, {0.0, theta[0]}};
  m.B = MatrixXd{{0.0}, {0.2}};
  m.C = MatrixXd{{theta[1], 0.0}, {0.3, 1.0}};
  m.D = MatrixXd{{0.1}, {0.0}};
  m.G = MatrixXd{{0.05}, {1.0}};
  m.Q = MatrixXd{{theta[2]}};
  m.R = MatrixXd{{theta[3], 0.02}, {0.02, 0.3}};
  m.S = MatrixXd{{0.01, 0.0}};
  m.x0 = VectorXd::Zero(2);
  m.P0 = MatrixXd::Identity(2, 2);
  return m;
}

struct Shown {
  std::vector<FilteredState> states;
  FilteredStateWatcher see() {
    return [this](const FilteredState& state) { states.push_back(state); };
  }
};

class LinearStates : public testing::TestWithParam<InitialState> {
 protected:
  void SetUp() override {
    Random random(11);
    y = MatrixXd(2, kRows);
    u = MatrixXd(1, kRows);
    for (Index t = 0; t < kRows; ++t) {
      y.col(t) << random.normal(), random.normal();
      u(0, t) = random.normal();
    }
    y(0, 4) = y(1, 7) = kNaN;
    y.col(9).setConstant(kNaN);
  }
  Shown shown_at(const Eigen::Vector4d& theta) const {
    Shown out;
    watch_filtered_states(drifting_mass(theta), GetParam(), y, u, {}, out.see());
    return out;
  }
  static constexpr Index kRows = 14;
  const Eigen::Vector4d theta{0.9, 1.2, 0.4, 0.2};
  MatrixXd y, u;
};

TEST_P(LinearStates, AreThoseOfTheFilter) {
  const FilterResult filter = kalman_filter(drifting_mass(theta), GetParam(), y, u);
  const Shown shown = shown_at(theta);
  ASSERT_EQ(static_cast<Index>(shown.states.size()), kRows - filter.first_proper);
  for (const FilteredState& state : shown.states) {
    EXPECT_LT((state.x - filter.x_filt.col(state.t)).norm(), 1e-13);
    EXPECT_LT((state.P - filter.P_filt[static_cast<std::size_t>(state.t)]).norm(), 1e-13);
  }
}

TEST_P(LinearStates, HaveTheDerivativesOfDifferences) {
  const double h = 1e-6;
  std::vector<StateSpace> derivatives;
  for (Index i = 0; i < 4; ++i) {
    const Eigen::Vector4d d = h * Eigen::Vector4d::Unit(i);
    StateSpace up = drifting_mass(theta + d), down = drifting_mass(theta - d);
    StateSpace by = up;
    for (MatrixXd StateSpace::*part :
         {&StateSpace::A, &StateSpace::B, &StateSpace::C, &StateSpace::D, &StateSpace::G,
          &StateSpace::Q, &StateSpace::R, &StateSpace::S, &StateSpace::P0}) {
      by.*part = (up.*part - down.*part) / (2.0 * h);
    }
    by.x0 = VectorXd::Zero(2);
    derivatives.push_back(std::move(by));
  }
  Shown shown;
  watch_filtered_states(drifting_mass(theta), GetParam(), y, u, derivatives, shown.see());
  for (Index i = 0; i < 4; ++i) {
    const Eigen::Vector4d d = h * Eigen::Vector4d::Unit(i);
    const Shown up = shown_at(theta + d), down = shown_at(theta - d);
    for (std::size_t k = 0; k < shown.states.size(); ++k) {
      const VectorXd dx = (up.states[k].x - down.states[k].x) / (2.0 * h);
      const MatrixXd dP = (up.states[k].P - down.states[k].P) / (2.0 * h);
      EXPECT_LT((shown.states[k].dx.col(i) - dx).norm(), 1e-7 * (1.0 + dx.norm()));
      EXPECT_LT((shown.states[k].dP.col(i) - dP.reshaped()).norm(), 1e-7 * (1.0 + dP.norm()));
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Starts, LinearStates,
                         testing::Values(InitialState::given, InitialState::diffuse));

// Seven states, eleven parameters, 400 samples: two blocks of lanes, gains that settle between gaps.
class ManyStates : public testing::Test {
 protected:
  void SetUp() override {
    Random random(23);
    model = random_model(random, 7, 1, 2, 3);
    for (int i = 0; i < 11; ++i) directions.push_back(random_direction(random, model));
    y = random_matrix(random, 2, 400);
    u = random_matrix(random, 1, 400);
    y(0, 120) = y(1, 300) = kNaN;
    y.middleCols(301, 3).setConstant(kNaN);
  }
  StateSpace moved(std::size_t i, double by) const {
    StateSpace out = model;
    const StateSpace& d = directions[i];
    for (MatrixXd StateSpace::*part :
         {&StateSpace::A, &StateSpace::B, &StateSpace::C, &StateSpace::D, &StateSpace::G,
          &StateSpace::Q, &StateSpace::R, &StateSpace::S, &StateSpace::P0}) {
      out.*part += by * d.*part;
    }
    out.x0 += by * d.x0;
    return out;
  }
  StateSpace model;
  std::vector<StateSpace> directions;
  MatrixXd y, u;
};

TEST_F(ManyStates, AreThoseOfTheFilterWithTheirDerivatives) {
  const double h = 1e-5;
  for (const InitialState start : {InitialState::given, InitialState::diffuse}) {
    const FilterResult filter = kalman_filter(model, start, y, u);
    Shown shown;
    watch_filtered_states(model, start, y, u, directions, shown.see());
    ASSERT_EQ(static_cast<Index>(shown.states.size()), y.cols() - filter.first_proper);
    for (const FilteredState& state : shown.states) {
      const MatrixXd& P = filter.P_filt[static_cast<std::size_t>(state.t)];
      EXPECT_LT((state.x - filter.x_filt.col(state.t)).norm(), 1e-11 * (1.0 + state.x.norm()));
      EXPECT_LT((state.P - P).norm(), 1e-11 * P.norm());
    }
    for (std::size_t i = 0; i < directions.size(); ++i) {
      const FilterResult up = kalman_filter(moved(i, h), start, y, u);
      const FilterResult down = kalman_filter(moved(i, -h), start, y, u);
      for (const FilteredState& state : shown.states) {
        const VectorXd dx = (up.x_filt - down.x_filt).col(state.t) / (2.0 * h);
        const auto t = static_cast<std::size_t>(state.t);
        const MatrixXd dP = (up.P_filt[t] - down.P_filt[t]) / (2.0 * h);
        const auto column = static_cast<Index>(i);
        EXPECT_LT((state.dx.col(column) - dx).norm(), 1e-6 * (1.0 + dx.norm())) << state.t;
        EXPECT_LT((state.dP.col(column) - dP.reshaped()).norm(), 1e-6 * (1.0 + dP.norm()))
            << state.t;
      }
    }
  }
}

class NonlinearStates : public testing::TestWithParam<NonlinearMethod> {};

TEST_P(NonlinearStates, HaveTheDerivativesOfDifferences) {
  const std::vector<std::string> names{"x", "v", "c", "t"};
  ModelFormulas formulas;
  formulas.states = 2;
  formulas.parameters = 1;
  formulas.continuous = false;
  formulas.dynamics = {parse_expression("x + 0.1*v", names),
                       parse_expression("v - 0.1*c*sin(x)", names)};
  formulas.outputs = {parse_expression("x + 0.2*x^2", names)};
  const NonlinearModel model = make_nonlinear_model(formulas, Derivatives::second);
  ModelMemory memory = make_memory(model);
  const Index rows = 12;
  MatrixXd y(1, rows);
  for (Index t = 0; t < rows; ++t) y(0, t) = std::sin(0.5 * static_cast<double>(t));
  y(0, 5) = kNaN;
  const InputNodes inputs = input_nodes(VectorXd::LinSpaced(rows, 0.0, 11.0), MatrixXd(0, rows),
                                        InputPath::constant, 100.0);
  NonlinearFilterOptions options;
  options.method = GetParam();
  const auto noise = [](double q) {
    return FilterNoise{MatrixXd{{0.01, 0.0}, {0.0, q}}, MatrixXd{{0.04}}, VectorXd{{0.1, 0.0}},
                       MatrixXd{{0.5, 0.0}, {0.0, 0.5}}};
  };
  FilterDirection by_c{0, zero_noise(model)}, by_q{-1, zero_noise(model)};
  by_q.noise.Q(1, 1) = 1.0;
  const auto shown_at = [&](double c, double q, const std::vector<FilterDirection>& by) {
    Shown out;
    watch_filtered_states(model, memory, VectorXd{{c}}, noise(q), by, inputs, y, options,
                          out.see());
    return out;
  };
  const double h = 1e-6;
  const Shown shown = shown_at(0.8, 0.02, {by_c, by_q});
  const Shown up[] = {shown_at(0.8 + h, 0.02, {}), shown_at(0.8, 0.02 + h, {})};
  const Shown down[] = {shown_at(0.8 - h, 0.02, {}), shown_at(0.8, 0.02 - h, {})};
  ASSERT_EQ(shown.states.size(), static_cast<std::size_t>(rows));
  for (std::size_t k = 0; k < shown.states.size(); ++k) {
    for (Index i = 0; i < 2; ++i) {
      const VectorXd dx = (up[i].states[k].x - down[i].states[k].x) / (2.0 * h);
      const MatrixXd dP = (up[i].states[k].P - down[i].states[k].P) / (2.0 * h);
      EXPECT_LT((shown.states[k].dx.col(i) - dx).norm(), 1e-6 * (1.0 + dx.norm())) << k;
      EXPECT_LT((shown.states[k].dP.col(i) - dP.reshaped()).norm(), 1e-6 * (1.0 + dP.norm())) << k;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Methods, NonlinearStates,
                         testing::Values(NonlinearMethod::extended, NonlinearMethod::iterated,
                                         NonlinearMethod::unscented));

}  // namespace
}  // namespace identikal
