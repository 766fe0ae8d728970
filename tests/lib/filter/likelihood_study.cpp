// Agreement of the likelihood's evaluation methods on long recordings, and definiteness over a
// million samples.
#include <cmath>
#include <cstdio>

#include <gtest/gtest.h>

#include "lib/filter/kalman.h"
#include "lib/filter/likelihood.h"
#include "tests/support/matisko_systems.h"
#include "tests/support/random_model.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

TEST(LikelihoodStudy, PathsAgreeOnLongRecordings) {
  double value = 0.0, gradient = 0.0;
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    Random random(seed);
    const auto n = static_cast<Index>(1 + seed % 6), nu = static_cast<Index>(seed % 2);
    const StateSpace m = random_model(random, n, nu, 2, n);
    const MatrixXd u = random_matrix(random, nu, 100000),
                   y = simulate_outputs(random, m, u, u.cols());
    std::vector<StateSpace> derivatives;
    for (int i = 0; i < 3; ++i) derivatives.push_back(random_direction(random, m));
    LikelihoodEngine engine;
    engine.add_recording(y, u);
    const Likelihood full =
        engine.evaluate(m, InitialState::stationary, derivatives, EvaluationMethod::time_varying);
    for (const EvaluationMethod method :
         {EvaluationMethod::steady_state, EvaluationMethod::autocovariances}) {
      const Likelihood l = engine.evaluate(m, InitialState::stationary, derivatives, method);
      ASSERT_EQ(engine.evaluation_taken().method, method);
      value = std::max(value, std::abs(l.value / full.value - 1.0));
      gradient = std::max(gradient, (l.gradient - full.gradient).cwiseAbs().maxCoeff() /
                                        full.gradient.cwiseAbs().maxCoeff());
    }
  }
  printf("N = 1e5: value %.1e, gradient %.1e of the full recursion's\n", value, gradient);
  EXPECT_LT(value, 1e-9);
  EXPECT_LT(gradient, 1e-9);
}

TEST(LikelihoodStudy, StaysDefiniteOverAMillionSamples) {
  const MatiskoSystem system = matisko_system(7);
  Random random(2);
  StateSpace m = true_system(system);
  m.x0 = Eigen::VectorXd::Zero(4);
  const MatrixXd u(0, 1000000), y = simulate_outputs(random, m, u, u.cols());
  for (const double scale : {1.0, 1e-12}) {
    m.R = scale * Eigen::Vector2d(1.5, 3.0).asDiagonal().toDenseMatrix();
    LikelihoodEngine engine;
    engine.add_recording(y, u);
    const Likelihood full =
        engine.evaluate(m, InitialState::stationary, {}, EvaluationMethod::time_varying);
    ASSERT_EQ(full.status, FilterStatus::ok) << scale;
    const Likelihood automatic = engine.evaluate(m, InitialState::stationary);
    ASSERT_EQ(automatic.status, FilterStatus::ok) << scale;
    printf("R x %.0e: %.6f by the full recursion, %.1e from it by %s\n", scale, full.value,
           automatic.value / full.value - 1.0, to_string(engine.evaluation_taken().method));
    EXPECT_LT(std::abs(automatic.value / full.value - 1.0), 1e-9);
  }
}

}  // namespace
}  // namespace identikal
