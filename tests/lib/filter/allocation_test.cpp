// No memory is allocated inside an evaluation. A program of its own.
#include <gtest/gtest.h>

#include "lib/filter/likelihood.h"
#include "lib/filter/online_filter.h"
#include "lib/model/nonlinear_model.h"
#include "lib/nonlinear/filter.h"
#include "lib/regression/error_growth.h"
#include "lib/regression/lagged_regressors.h"
#include "lib/regression/recursive_least_squares.h"
#include "lib/statistics/sequential_probability_ratio.h"
#include "tests/support/counted_malloc.h"
#include "tests/support/random_model.h"

namespace identikal {
namespace {

TEST(Allocation, NoneInsideAnEvaluation) {
  for (Eigen::Index n = 1; n <= 6; ++n) {
    for (Eigen::Index ny = 1; ny <= 3; ++ny) {
      Random random(static_cast<std::uint64_t>(10 * n + ny));
      const StateSpace m = random_model(random, n, 0, ny, n);
      const Eigen::MatrixXd u(0, 3000), y = simulate_outputs(random, m, u, 3000);
      std::vector<StateSpace> derivatives;
      for (int i = 0; i < 5; ++i) derivatives.push_back(noise_direction(random, m));
      const std::vector<StateSpace> none;
      LikelihoodEngine engine;
      engine.add_recording(y, u);
      engine.evaluate(m, InitialState::stationary, derivatives);
      ASSERT_EQ(engine.evaluation_taken().method, EvaluationMethod::autocovariances)
          << n << " " << ny;
      double value = 0.0;
      const long allocations = allocations_of(
          [&] { value = engine.evaluate(m, InitialState::stationary, derivatives).value; });
      EXPECT_EQ(allocations, 0) << n << " states, " << ny << " outputs";
      EXPECT_TRUE(std::isfinite(value));
    }
  }
}

TEST(Allocation, NoneInAStepOfTheOnlineFilter) {
  for (Eigen::Index n = 1; n <= 6; ++n) {
    Random random(static_cast<std::uint64_t>(n));
    const StateSpace model = random_model(random, n, 1, 2, n);
    OnlineFilter filter = start_online_filter(model, InitialState::diffuse);
    Eigen::VectorXd y = Eigen::VectorXd::Zero(2), u = Eigen::VectorXd::Zero(1);
    for (int t = 0; t < 20; ++t) step(filter, y, u);
    const long allocations = allocations_of([&] {
      for (int t = 0; t < 100; ++t) {
        y[0] = t % 7 == 0 ? std::numeric_limits<double>::quiet_NaN() : 0.1 * t;
        step(filter, y, u);
      }
    });
    EXPECT_EQ(allocations, 0) << n << " states";
  }
}

TEST(Allocation, NoneInAnUpdateOfTheSequentialTest) {
  for (Eigen::Index ny = 1; ny <= 4; ++ny) {
    Random random(static_cast<std::uint64_t>(ny));
    Eigen::MatrixXd e(ny, 5000);
    for (Eigen::Index t = 0; t < e.cols(); ++t) e.col(t) = random.normal(ny);
    SequentialProbabilityRatio test = start_sequential_probability_ratio(ny, {});
    int decisions = 0;
    const long allocations = allocations_of([&] {
      for (Eigen::Index t = 0; t < e.cols(); ++t) {
        decisions += update(test, e.col(t)) != SequentialDecision::undecided;
      }
    });
    EXPECT_EQ(allocations, 0) << ny << " outputs";
    EXPECT_GT(decisions, 0) << ny << " outputs";
  }
}

TEST(Allocation, NoneInAnUpdateOfRecursiveLeastSquares) {
  for (Eigen::Index ny = 1; ny <= 3; ++ny) {
    Random random(static_cast<std::uint64_t>(ny));
    const Eigen::MatrixXd phi = random_matrix(random, 7, 1000), y = random_matrix(random, ny, 1000);
    RecursiveLeastSquares rls = start_recursive_least_squares(7, ny, 0.1);
    ErrorGrowth growth = start_error_growth(1e4, 10);
    double sum = 0.0;
    const long allocations = allocations_of([&] {
      for (Eigen::Index t = 0; t < phi.cols(); ++t) {
        sum += leverage(rls, phi.col(t));
        update(rls, phi.col(t), y.col(t), 0.98);
        update(growth, rls.prior_error[0]);
      }
    });
    EXPECT_EQ(allocations, 0) << ny << " outputs";
    EXPECT_TRUE(std::isfinite(sum));
  }
}

TEST(Allocation, NoneInAStepOfOnlineLeastSquares) {
  Random random(5);
  const Eigen::MatrixXd u = random_matrix(random, 2, 1000), y = random_matrix(random, 1, 1000);
  Forgetting forgetting;
  forgetting.memory = 100.0;
  forgetting.reset = true;
  LagWindow window = start_lag_window(2, {3, 2});
  OnlineLeastSquares online = start_online_least_squares(window.phi.size(), 0.0, forgetting);
  const long allocations = allocations_of([&] {
    for (Eigen::Index t = 0; t < u.cols(); ++t) {
      if (take(window, u.col(t), y(0, t))) step(online, window.phi, y(0, t));
    }
  });
  EXPECT_EQ(allocations, 0);
  EXPECT_TRUE(online.sd.allFinite());
}

TEST(Allocation, NoneInAStepOfANonlinearModel) {
  const std::vector<std::string> names{"phi", "w", "torque", "l", "c", "t"};
  ModelFormulas formulas;
  formulas.states = 2;
  formulas.inputs = 1;
  formulas.parameters = 2;
  for (const char* f : {"w", "-g/l*sin(phi) - c*w*abs(w) + if(t > 1, torque, 0)"}) {
    formulas.dynamics.push_back(parse_expression(f, names));
  }
  formulas.outputs.push_back(parse_expression("l*sin(phi)", names));
  const NonlinearModel model = make_nonlinear_model(formulas, Derivatives::second);
  ModelMemory memory = make_memory(model);
  const InputNodes inputs = input_nodes(Eigen::VectorXd::LinSpaced(200, 0.0, 2.0),
                                        Eigen::MatrixXd::Ones(1, 200), InputPath::linear, 0.004);
  const Eigen::VectorXd p = Eigen::Vector2d(0.8, 0.1), u = Eigen::VectorXd::Ones(1);
  Eigen::VectorXd x = Eigen::Vector2d(0.5, 0.0), y(1);
  Jacobian jacobian, y_jacobian;
  set_parameters(model, memory, p);
  observe(model, memory, x, u, 0.0, y, y_jacobian, Derivatives::second);
  step(model, memory, inputs, 0, x, jacobian, Derivatives::second);
  const long allocations = allocations_of([&] {
    set_parameters(model, memory, p);
    for (Eigen::Index k = 0; k + 1 < 200; ++k) {
      observe(model, memory, x, u, inputs.time[k], y, y_jacobian, Derivatives::second);
      step(model, memory, inputs, k, x, jacobian, Derivatives::second);
      step(model, memory, inputs, k, x, jacobian);
      step(model, memory, inputs, k, x);
    }
  });
  EXPECT_EQ(allocations, 0);
  EXPECT_TRUE(x.allFinite());
}

// What a filter allocates does not grow with the samples.
TEST(Allocation, NoneAtASampleOfANonlinearFilter) {
  const std::vector<std::string> names{"phi", "w", "torque", "l", "c", "t"};
  ModelFormulas formulas;
  formulas.states = 2;
  formulas.inputs = 1;
  formulas.parameters = 2;
  for (const char* f : {"w", "-g/l*sin(phi) - c*w + torque"}) {
    formulas.dynamics.push_back(parse_expression(f, names));
  }
  formulas.outputs.push_back(parse_expression("l*sin(phi)", names));
  formulas.outputs.push_back(parse_expression("w", names));
  const NonlinearModel model = make_nonlinear_model(formulas, Derivatives::second);
  ModelMemory memory = make_memory(model);
  const Eigen::VectorXd p = Eigen::Vector2d(0.8, 0.1);
  std::vector<FilterDirection> directions;
  for (Eigen::Index i = 0; i < 4; ++i) {
    directions.push_back({i < 2 ? i : -1, zero_noise(model)});
    if (i == 2) directions.back().noise.Q(1, 1) = 1.0;
    if (i == 3) directions.back().noise.R(0, 0) = 1.0;
  }
  FilterNoise noise = zero_noise(model);
  noise.Q = noise.P0 = 0.1 * Eigen::MatrixXd::Identity(2, 2);
  noise.R = 0.1 * Eigen::MatrixXd::Identity(2, 2);
  FilterNoise no_process_noise = noise;
  no_process_noise.Q.setZero();
  no_process_noise.P0.setZero();
  const std::vector<FilterDirection> only_parameters(directions.begin(), directions.begin() + 2);
  const auto allocated = [&](Eigen::Index N, const NonlinearFilterOptions& options, bool gradient,
                             bool output_error) {
    const InputNodes inputs =
        input_nodes(Eigen::VectorXd::LinSpaced(N, 0.0, 0.01 * static_cast<double>(N - 1)),
                    Eigen::MatrixXd::Ones(1, N), InputPath::linear, 0.01);
    Eigen::MatrixXd y = Eigen::MatrixXd::Zero(2, N);
    for (Eigen::Index t = 0; t < N; t += 7) y(t % 2, t) = std::nan("");
    std::vector<FilterDirection> by;
    if (gradient) by = output_error ? only_parameters : directions;
    Likelihood l;
    const auto evaluate = [&] {
      l = nonlinear_likelihood(model, memory, p, output_error ? no_process_noise : noise, by,
                               inputs, y, options);
    };
    evaluate();  // the model's memory is ready then
    const long allocations = allocations_of(evaluate);
    EXPECT_EQ(l.status, FilterStatus::ok);
    return allocations;
  };
  for (const NonlinearMethod method :
       {NonlinearMethod::extended, NonlinearMethod::iterated, NonlinearMethod::unscented}) {
    for (const bool gradient : {false, true}) {
      for (const bool output_error : {false, true}) {
        NonlinearFilterOptions options;
        options.method = method;
        options.noise = ProcessNoise::density;
        EXPECT_EQ(allocated(200, options, gradient, output_error),
                  allocated(100, options, gradient, output_error))
            << static_cast<int>(method) << gradient << output_error;
      }
    }
  }
}

}  // namespace
}  // namespace identikal
