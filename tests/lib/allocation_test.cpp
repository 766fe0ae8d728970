// No memory is allocated inside an evaluation. A program of its own: it counts what malloc() is
// asked for.
#include <atomic>
#include <cstdlib>

#include <gtest/gtest.h>

#include "lib/growth_test.h"
#include "lib/likelihood.h"
#include "lib/nonlinear_model.h"
#include "lib/recursive_least_squares.h"
#include "lib/sequential_test.h"
#include "tests/support/random_model.h"

namespace {
std::atomic<bool> counting{false};
std::atomic<long> allocations{0};
}  // namespace

extern "C" void* __libc_malloc(std::size_t size);
extern "C" void* malloc(std::size_t size) noexcept {
  if (counting) ++allocations;
  return __libc_malloc(size);
}

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
      ASSERT_EQ(engine.path_taken().path, Path::compressed) << n << " " << ny;
      allocations = 0;
      counting = true;
      const double value = engine.evaluate(m, InitialState::stationary, derivatives).value;
      counting = false;
      EXPECT_EQ(allocations, 0) << n << " states, " << ny << " outputs";
      EXPECT_TRUE(std::isfinite(value));
    }
  }
}

TEST(Allocation, NoneInAnUpdateOfTheSequentialTest) {
  for (Eigen::Index ny = 1; ny <= 4; ++ny) {
    Random random(static_cast<std::uint64_t>(ny));
    Eigen::MatrixXd e(ny, 5000);
    for (Eigen::Index t = 0; t < e.cols(); ++t) e.col(t) = random.normal(ny);
    SequentialTest test = start_sequential_test(ny, {});
    int decisions = 0;
    allocations = 0;
    counting = true;
    for (Eigen::Index t = 0; t < e.cols(); ++t) {
      decisions += update(test, e.col(t)) != SequentialDecision::undecided;
    }
    counting = false;
    EXPECT_EQ(allocations, 0) << ny << " outputs";
    EXPECT_GT(decisions, 0) << ny << " outputs";
  }
}

TEST(Allocation, NoneInAnUpdateOfRecursiveLeastSquares) {
  for (Eigen::Index ny = 1; ny <= 3; ++ny) {
    Random random(static_cast<std::uint64_t>(ny));
    const Eigen::MatrixXd phi = random_matrix(random, 7, 1000), y = random_matrix(random, ny, 1000);
    RecursiveLeastSquares rls = start_recursive_least_squares(7, ny, 0.1);
    GrowthTest growth = start_growth_test(1e4, 10);
    double sum = 0.0;
    allocations = 0;
    counting = true;
    for (Eigen::Index t = 0; t < phi.cols(); ++t) {
      sum += leverage(rls, phi.col(t));
      update(rls, phi.col(t), y.col(t), 0.98);
      update(growth, rls.prior_error[0]);
    }
    counting = false;
    EXPECT_EQ(allocations, 0) << ny << " outputs";
    EXPECT_TRUE(std::isfinite(sum));
  }
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
  Slopes slopes, y_slopes;
  set_parameters(model, memory, p);
  observe(model, memory, x, u, 0.0, y, y_slopes, Derivatives::second);
  step(model, memory, inputs, 0, x, slopes, Derivatives::second);
  allocations = 0;
  counting = true;
  set_parameters(model, memory, p);
  for (Eigen::Index k = 0; k + 1 < 200; ++k) {
    observe(model, memory, x, u, inputs.time[k], y, y_slopes, Derivatives::second);
    step(model, memory, inputs, k, x, slopes, Derivatives::second);
    step(model, memory, inputs, k, x, slopes);
    step(model, memory, inputs, k, x);
  }
  counting = false;
  EXPECT_EQ(allocations, 0);
  EXPECT_TRUE(x.allFinite());
}

}  // namespace
}  // namespace identikal
