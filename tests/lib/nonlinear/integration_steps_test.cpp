#include "lib/nonlinear/integration_steps.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <stdexcept>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "lib/base/constants.h"
#include "lib/formula/expression.h"
#include "lib/nonlinear/filter.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

NonlinearModel rates_of(const std::vector<std::string>& rates, bool continuous = true) {
  const std::vector<std::string> names{"a", "b", "u", "k", "t"};
  ModelFormulas formulas;
  formulas.states = 2;
  formulas.inputs = 1;
  formulas.parameters = 1;
  formulas.continuous = continuous;
  for (const std::string& rate : rates) formulas.dynamics.push_back(parse_expression(rate, names));
  formulas.outputs.push_back(parse_expression("a", names));
  return make_nonlinear_model(formulas);
}
// Relaxation oscillation: slow, then all at once.
NonlinearModel van_der_pol() { return rates_of({"b", "k*(1 - a^2)*b - a + u"}); }

MatrixXd trajectory(const NonlinearModel& model, const VectorXd& p, VectorXd x,
                    const InputNodes& inputs) {
  ModelMemory memory = make_memory(model);
  set_parameters(model, memory, p);
  MatrixXd out(x.size(), inputs.time.size());
  out.col(0) = x;
  for (Index k = 0; k + 1 < inputs.time.size(); ++k) {
    step(model, memory, inputs, k, x);
    out.col(k + 1) = x;
  }
  return out;
}

TEST(IntegrationSteps, AsManyAsTheTrajectoryNeeds) {
  const NonlinearModel model = van_der_pol();
  const Index N = 200;
  const VectorXd p = VectorXd::Constant(1, 8.0), x0 = Eigen::Vector2d(2.0, 0.0);
  const VectorXd time = VectorXd::LinSpaced(N, 0.0, 20.0);
  const MatrixXd u = (0.3 * time.array()).sin().matrix().transpose();
  for (const InputPath path : {InputPath::constant, InputPath::linear, InputPath::pchip}) {
    const MatrixXd exact = trajectory(
        model, p, x0,
        input_nodes(time, u, path, std::vector<int>(static_cast<std::size_t>(N - 1), 2000)));
    for (const double tolerance : {1e-5, 1e-8}) {
      const IntegrationSteps chosen =
          integration_steps(model, p, x0, time, u, path, {tolerance, 1e-3, 1024});
      ASSERT_EQ(chosen.status, StepStatus::ok);
      EXPECT_LE(chosen.largest_change, tolerance);
      const auto [least, most] = std::minmax_element(chosen.steps.begin(), chosen.steps.end());
      const InputNodes grid = input_nodes(time, u, path, chosen.steps);
      const double error = (trajectory(model, p, x0, grid) - exact).cwiseAbs().maxCoeff() /
                           exact.cwiseAbs().maxCoeff();
      double total = 0.0;
      for (const int steps : chosen.steps) total += steps;
      std::printf("tolerance %.0e: %d to %d steps, %.1f on average, error of the trajectory %.1e\n",
                  tolerance, *least, *most, total / static_cast<double>(N - 1), error);
      EXPECT_GE(*most, 8 * *least);
      // Errors of the jump's time add up over a few periods.
      EXPECT_LT(error, 100.0 * tolerance);
      // Half the steps do not do in any interval: the states at the begins are those of the run.
      int finer_than_needed = 0;
      ModelMemory memory = make_memory(model);
      set_parameters(model, memory, p);
      for (Index k = 0; k + 1 < N; ++k) {
        const int steps = chosen.steps[static_cast<std::size_t>(k)];
        if (steps == 1) continue;
        std::vector<int> half = chosen.steps;
        half[static_cast<std::size_t>(k)] = steps / 2;
        VectorXd coarse = exact.col(k), fine = exact.col(k);
        step(model, memory, input_nodes(time, u, path, half), k, coarse);
        step(model, memory, grid, k, fine);
        const VectorXd measure =
            fine.cwiseAbs().cwiseMax(1e-3 * exact.cwiseAbs().rowwise().maxCoeff());
        const double by = ((coarse - fine).cwiseAbs().array() / measure.array()).maxCoeff();
        if (by < 0.9 * tolerance) ++finer_than_needed;
      }
      EXPECT_EQ(finer_than_needed, 0);
    }
  }
}

TEST(IntegrationSteps, SayWhatCannotBeFollowed) {
  const VectorXd p = VectorXd::Constant(1, 1.0), x0 = Eigen::Vector2d(1.0, 0.0);
  const VectorXd time = VectorXd::LinSpaced(21, 0.0, 2.0);
  const MatrixXd u = MatrixXd::Zero(1, 21);
  // a = 1 / (1 - t) leaves at t = 1, in the interval that begins with sample 10.
  const IntegrationSteps lost =
      integration_steps(rates_of({"k*a^2", "0"}), p, x0, time, u, InputPath::linear);
  EXPECT_NE(lost.status, StepStatus::ok);
  EXPECT_GE(lost.sample, 9);
  EXPECT_LE(lost.sample, 10);
  const IntegrationSteps outside =
      integration_steps(rates_of({"sqrt(0.55 - t)", "0"}), p, x0, time, u, InputPath::linear);
  EXPECT_EQ(outside.status, StepStatus::not_finite);
  EXPECT_EQ(outside.sample, 5);
  EXPECT_TRUE(outside.steps.empty());
  const IntegrationSteps stiff = integration_steps(rates_of({"-1e5*k*(a - cos(t))", "0"}), p, x0,
                                                   time, u, InputPath::linear, {1e-8, 1e-3, 16});
  EXPECT_EQ(stiff.status, StepStatus::not_finite);
  EXPECT_LE(stiff.sample, 1);
  const IntegrationSteps capped = integration_steps(van_der_pol(), VectorXd::Constant(1, 8.0), x0,
                                                    time, u, InputPath::linear, {1e-10, 1e-3, 4});
  EXPECT_EQ(capped.status, StepStatus::capped);
  EXPECT_EQ(*std::max_element(capped.steps.begin(), capped.steps.end()), 4);
  const IntegrationSteps discrete =
      integration_steps(rates_of({"k*a", "b"}, false), p, x0, time, u, InputPath::constant);
  EXPECT_EQ(discrete.steps, std::vector<int>(20, 1));
  // A state at rest needs no finer step, whatever its unit.
  EXPECT_EQ(
      integration_steps(rates_of({"0", "0"}), p, VectorXd::Zero(2), time, u, InputPath::linear)
          .steps,
      std::vector<int>(20, 1));
  const NonlinearModel model = van_der_pol();
  EXPECT_THROW(integration_steps(model, VectorXd(2), x0, time, u, InputPath::linear),
               std::invalid_argument);
  EXPECT_THROW(integration_steps(model, p, VectorXd(3), time, u, InputPath::linear),
               std::invalid_argument);
  EXPECT_THROW(integration_steps(model, p, x0, time, MatrixXd(1, 3), InputPath::linear),
               std::invalid_argument);
  EXPECT_THROW(integration_steps(model, p, x0, time.reverse(), u, InputPath::linear),
               std::invalid_argument);
  EXPECT_THROW(integration_steps(model, p, x0, time, u, InputPath::linear, {0.0, 1.0, 1}),
               std::invalid_argument);
}

// A pendulum that hangs still in the mean needs no step; its deviations and its filter do.
TEST(IntegrationSteps, FiltersLookAroundTheirMean) {
  const NonlinearModel model = rates_of({"b", "-39*k*sin(a) - 0.2*b"});
  const Index N = 60;
  const VectorXd p = VectorXd::Constant(1, 1.0), time = VectorXd::LinSpaced(N, 0.0, 11.8);
  const MatrixXd u = MatrixXd::Zero(1, N), y = (6.0 * time.array()).sin().matrix().transpose();
  FilterNoise noise = zero_noise(model);
  noise.Q(1, 1) = 0.5;
  noise.R(0, 0) = 1e-4;
  NonlinearFilterOptions options;
  options.noise = ProcessNoise::density;
  const auto value_with = [&](const std::vector<int>& steps) {
    return nonlinear_filter(model, p, noise, input_nodes(time, u, InputPath::linear, steps), y,
                            options)
        .log_likelihood;
  };
  const std::vector<int> at_rest =
      integration_steps(model, p, VectorXd::Zero(2), time, u, InputPath::linear).steps;
  EXPECT_EQ(at_rest, std::vector<int>(59, 1));
  for (const bool certain : {false, true}) {
    noise.P0 = certain ? MatrixXd::Zero(2, 2) : MatrixXd(0.01 * MatrixXd::Identity(2, 2));
    const IntegrationSteps chosen =
        integration_steps(model, p, noise, time, u, InputPath::linear, y, options);
    EXPECT_EQ(chosen.status, StepStatus::ok);
    const double exact = value_with(std::vector<int>(59, 256));
    std::printf("log-likelihood %.6f, by one step %.3f off, by %d to %d steps %.1e\n", exact,
                value_with(at_rest) - exact,
                *std::min_element(chosen.steps.begin(), chosen.steps.end()),
                *std::max_element(chosen.steps.begin(), chosen.steps.end()),
                value_with(chosen.steps) - exact);
    // Chance moves it by more than 1.
    EXPECT_NEAR(value_with(chosen.steps), exact, 1e-3);
    EXPECT_GT(std::abs(value_with(at_rest) - exact), 10.0);
  }
}

TEST(IntegrationSteps, AJumpTakesAFewSteps) {
  const NonlinearModel model = rates_of({"b", "-10*a - sign(b)*k"});
  const VectorXd p = VectorXd::Constant(1, 1.0), time = VectorXd::LinSpaced(101, 0.0, 10.0);
  const IntegrationSteps chosen = integration_steps(model, p, Eigen::Vector2d(3.0, 0.0), time,
                                                    MatrixXd::Zero(1, 101), InputPath::linear);
  EXPECT_EQ(chosen.status, StepStatus::capped);
  EXPECT_LE(*std::max_element(chosen.steps.begin(), chosen.steps.end()), 64);
}

// An unstable plant in a closed loop: alone it diverges, with its measurements it does not.
TEST(IntegrationSteps, AFilterNeedsNoMotionOfItsOwn) {
  const NonlinearModel model = rates_of({"k*a + a^3 + u", "-b"});
  const Index N = 200;
  const VectorXd p = VectorXd::Constant(1, 1.0), time = VectorXd::LinSpaced(N, 0.0, 20.0);
  MatrixXd u(1, N), y(1, N);
  for (Index k = 0; k < N; ++k) {
    y(0, k) = 0.3 * std::sin(time[k]);
    u(0, k) = 0.3 * std::cos(time[k]) - y(0, k) - std::pow(y(0, k), 3);
  }
  FilterNoise noise = zero_noise(model);
  noise.Q(0, 0) = 1e-3;
  noise.R(0, 0) = 1e-4;
  noise.P0(0, 0) = 0.01;
  NonlinearFilterOptions options;
  options.noise = ProcessNoise::density;
  EXPECT_EQ(
      integration_steps(model, p, Eigen::Vector2d(0.3, 0.0), time, u, InputPath::linear).status,
      StepStatus::not_finite);
  EXPECT_EQ(integration_steps(model, p, noise, time, u, InputPath::linear, y, options).status,
            StepStatus::ok);
}

}  // namespace
}  // namespace identikal
