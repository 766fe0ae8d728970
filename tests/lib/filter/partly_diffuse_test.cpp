// A start that is diffuse for some states and not for others, against the joint Gaussian density of a
// short record.
#include "lib/model/partly_diffuse.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "lib/base/constants.h"
#include "lib/base/random.h"
#include "lib/filter/kalman.h"
#include "lib/filter/likelihood.h"
#include "lib/filter/online_filter.h"
#include "lib/filter/smoother.h"
#include "tests/support/joint_density.h"
#include "tests/support/random_model.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index kPartlyDiffuseRows = 40;

// Nothing is known of the first states.
struct PartlyDiffuseCase {
  StateSpace model;
  Index diffuse;
  MatrixXd y, u;
};

void forget(StateSpace& m, Index states, double variance) {
  m.x0.head(states).setZero();
  m.P0.topRows(states).setZero();
  m.P0.leftCols(states).setZero();
  m.P0.diagonal().head(states).setConstant(variance);
}

PartlyDiffuseCase partly_diffuse_case(std::uint64_t seed) {
  Random random(seed);
  const Index n = 2 + static_cast<Index>(seed % 5), ny = 1 + static_cast<Index>(seed % 2);
  PartlyDiffuseCase out{
      random_model(random, n, 1, ny, 2), 1 + static_cast<Index>(seed) % (n - 1), {}, {}};
  out.y = 3.0 * random_matrix(random, ny, kPartlyDiffuseRows);
  out.u = random_matrix(random, 1, kPartlyDiffuseRows);
  if (seed % 3 == 0) {
    out.y(0, 0) = std::nan("");
    out.y.col(kPartlyDiffuseRows / 2).setConstant(std::nan(""));
  }
  forget(out.model, out.diffuse, kInfinity);
  return out;
}

// From the density of what is measured: the diffuse states by the limit in closed form.
double by_joint_density(const PartlyDiffuseCase& c) {
  StateSpace known = c.model;
  forget(known, c.diffuse, 0.0);
  Stacked all = stack(known, c.u, kPartlyDiffuseRows, known.x0, known.P0);
  all.from_x1 = all.from_x1.leftCols(c.diffuse).eval();
  return diffuse_log_density(all, c.y);
}

std::vector<StateSpace> start_directions(const PartlyDiffuseCase& c, std::uint64_t seed) {
  Random random(seed);
  std::vector<StateSpace> out{random_direction(random, c.model), noise_direction(random, c.model)};
  for (StateSpace& d : out) {
    d.x0 = random_matrix(random, c.model.states(), 1);
    const MatrixXd half = random_matrix(random, c.model.states(), c.model.states());
    d.P0 = half + half.transpose();
    forget(d, c.diffuse, 0.0);
  }
  return out;
}

TEST(PartlyDiffuse, TheLikelihoodIsTheJointDensityWithExactSlopes) {
  constexpr double kStep = 1e-5;
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    const PartlyDiffuseCase c = partly_diffuse_case(seed);
    const double expected = by_joint_density(c);
    const std::vector<StateSpace> by = start_directions(c, seed + 100);
    const Likelihood one = log_likelihood(c.model, InitialState::partly_diffuse, c.y, c.u, by);
    ASSERT_EQ(one.status, FilterStatus::ok) << seed;
    EXPECT_NEAR(one.value, expected, 1e-9 * std::abs(expected)) << seed;
    LikelihoodEngine engine;
    engine.add_recording(c.y, c.u);
    const Likelihood fast = engine.evaluate(c.model, InitialState::partly_diffuse, by);
    EXPECT_NEAR(fast.value, expected, 1e-9 * std::abs(expected)) << seed;
    for (std::size_t i = 0; i < by.size(); ++i) {
      PartlyDiffuseCase up = c, down = c;
      up.model = moved(c.model, by[i], kStep);
      down.model = moved(c.model, by[i], -kStep);
      const double slope = (by_joint_density(up) - by_joint_density(down)) / (2.0 * kStep);
      EXPECT_NEAR(one.gradient[static_cast<Index>(i)], slope, 1e-5 * (1.0 + std::abs(slope)))
          << seed;
      EXPECT_NEAR(fast.gradient[static_cast<Index>(i)], one.gradient[static_cast<Index>(i)],
                  1e-8 * (1.0 + std::abs(slope)))
          << seed;
    }
  }
}

TEST(PartlyDiffuse, FiltersAndSmoothersAgreeAtTheLastSample) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const PartlyDiffuseCase c = partly_diffuse_case(seed);
    const InitialState start = InitialState::partly_diffuse;
    const FilterResult filter = kalman_filter(c.model, start, c.y, c.u);
    const SmootherResult smoothed = smooth(c.model, start, c.y, c.u);
    OnlineFilter online = start_online_filter(c.model, start);
    for (Index t = 0; t < kPartlyDiffuseRows; ++t)
      ASSERT_TRUE(step(online, c.y.col(t), c.u.col(t)));
    const VectorXd last = filter.x_filt.col(kPartlyDiffuseRows - 1);
    const double scale = 1e-9 * (1.0 + last.norm());
    EXPECT_LT((smoothed.x.col(kPartlyDiffuseRows - 1) - last).norm(), scale) << seed;
    EXPECT_LT((online.state - last).norm(), scale) << seed;
    EXPECT_LT((online.state_sd - smoothed.sd.col(kPartlyDiffuseRows - 1)).norm(), scale) << seed;
  }
}

// A random walk, an autoregression in its steady state and a bias known to 0.2.
struct LevelAndError {
  ParameterSet parameters;
  LinearModel model;
};

LevelAndError level_and_error() {
  LevelAndError out;
  for (const double value : {0.8, 0.5}) {
    Parameter p;
    p.value = MatrixXd::Constant(1, 1, value);
    out.parameters.push_back(p);
  }
  LinearModel& m = out.model;
  m.A = constant_matrix(Eigen::Vector3d(1.0, 0.0, 1.0).asDiagonal());
  m.A.entries = {{1, 1, 0, 1.0}};
  m.B = constant_matrix(MatrixXd(3, 0));
  m.C = constant_matrix(MatrixXd::Ones(1, 3));
  m.D = constant_matrix(MatrixXd(1, 0));
  m.G = constant_matrix(MatrixXd::Identity(3, 3));
  m.Q = constant_matrix(Eigen::Vector3d(0.1, 0.0, 0.0).asDiagonal());
  m.Q.entries = {{1, 1, 1, 1.0}};
  m.R = constant_matrix(MatrixXd::Ones(1, 1));
  m.S = constant_matrix(MatrixXd::Zero(3, 1));
  m.initial = InitialState::partly_diffuse;
  m.stationary = {1};
  m.known = {{2, 0.3, 0.2}};
  return out;
}

TEST(PartlyDiffuse, ASteadyStartMovesWithItsParameters) {
  const LevelAndError s = level_and_error();
  const StateSpace at = instantiate(s.model, s.parameters);
  EXPECT_TRUE(std::isinf(at.P0(0, 0)));
  EXPECT_NEAR(at.P0(1, 1), 0.5 / (1.0 - 0.64), 1e-12);
  EXPECT_NEAR(at.P0(2, 2), 0.04, 1e-15);
  EXPECT_EQ(at.x0[2], 0.3);
  const std::vector<StateSpace> by = model_derivatives(s.model, s.parameters);
  EXPECT_NEAR(by[0].P0(1, 1), 0.5 * 1.6 / (0.36 * 0.36), 1e-10);
  EXPECT_NEAR(by[1].P0(1, 1), 1.0 / 0.36, 1e-12);
  EXPECT_FALSE(is_linear_in_parameters(s.model, s.parameters));
}

TEST(PartlyDiffuse, AnUnstableSteadyStartIsSaid) {
  LevelAndError s = level_and_error();
  s.parameters[0].value(0, 0) = 1.1;
  const StateSpace at = instantiate(s.model, s.parameters);
  const MatrixXd y = MatrixXd::Ones(1, 5), u(0, 5);
  EXPECT_EQ(kalman_filter(at, InitialState::partly_diffuse, y, u).status, FilterStatus::unstable);
  EXPECT_THROW(start_online_filter(at, InitialState::partly_diffuse), std::invalid_argument);
}

}  // namespace
}  // namespace identikal
