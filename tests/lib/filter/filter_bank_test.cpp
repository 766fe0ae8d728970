#include "lib/filter/filter_bank.h"

#include <chrono>
#include <cmath>
#include <cstdio>
#include <limits>

#include <gtest/gtest.h>

#include "lib/filter/kalman.h"
#include "tests/support/random_model.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// The witness is the filter of lib/filter/kalman.h, whose own are the joint density and dense
// algebra.
TEST(FilterBank, EveryMemberIsTheKalmanFilterOfItsNoise) {
  constexpr Index kSamples = 60;
  double worst = 0.0;
  for (Index n = 1; n <= 6; ++n) {
    for (Index ny = 1; ny <= 4; ++ny) {
      Random random(static_cast<std::uint64_t>(100 * n + ny));
      const StateSpace shared = random_model(random, n, 2, ny, n);
      const MatrixXd u = random_matrix(random, 2, kSamples);
      MatrixXd y = simulate_outputs(random, shared, u, kSamples);
      for (Index t = 5; t < kSamples; t += 7) y(t % ny, t) = std::nan("");
      y.col(30).setConstant(std::nan(""));
      const Index members = 5 + 11 * (n % 3);
      FilterBank bank = filter_bank(shared, members);
      std::vector<StateSpace> models;
      for (Index i = 0; i < members; ++i) {
        StateSpace m = random_model(random, n, 2, ny, n);
        m.A = shared.A;
        m.B = shared.B;
        m.C = shared.C;
        m.D = shared.D;
        models.push_back(m);
        set_noise(bank, i, m);
        set_state(bank, i, m.x0, m.P0);
      }
      VectorXd sum = VectorXd::Zero(members), density(members);
      for (Index t = 0; t + 1 < kSamples; ++t) {
        step(bank, y.col(t), u.col(t), density);
        sum += density;
      }
      MatrixXd before_last = y;
      before_last.col(kSamples - 1).setConstant(std::nan(""));
      for (Index i = 0; i < members; ++i) {
        const FilterResult one =
            kalman_filter(models[static_cast<std::size_t>(i)], InitialState::given, before_last, u);
        VectorXd weight = VectorXd::Unit(members, i);
        const Mixture m = mixture(bank, weight);
        const auto apart = [&worst](double difference, double size) {
          worst = std::max(worst, difference / size);
        };
        apart(std::abs(sum[i] - one.log_likelihood), std::abs(one.log_likelihood));
        apart((m.x - one.x_pred.col(kSamples - 1)).norm(), one.x_pred.col(kSamples - 1).norm());
        apart((m.P - one.P_pred.back()).norm(), one.P_pred.back().norm());
        apart((m.R - models[static_cast<std::size_t>(i)].R).norm(), 1.0);
      }
    }
  }
  std::printf("bank against kalman_filter, 24 models: %.1e\n", worst);
  EXPECT_LT(worst, 1e-11);
}

TEST(FilterBank, MixtureHasTheMomentsOfTheMixture) {
  Random random(3);
  const StateSpace m = random_model(random, 2, 0, 1, 2);
  FilterBank bank = filter_bank(m, 2);
  for (Index i = 0; i < 2; ++i) {
    set_noise(bank, i, m);
    set_state(bank, i, Eigen::Vector2d(i == 0 ? 1.0 : -1.0, 0.0),
              (1.0 + i) * MatrixXd::Identity(2, 2));
  }
  const Mixture out = mixture(bank, Eigen::Vector2d(0.25, 0.75));
  EXPECT_NEAR(out.x[0], -0.5, 1e-15);
  EXPECT_NEAR(out.P(0, 0), 1.75 + 0.75, 1e-15);  // mean of variances, variance of means
  EXPECT_NEAR(out.P(1, 1), 1.75, 1e-15);
}

TEST(FilterBank, NoiseThatIsNoneHasNoDensityAndDisturbsNobody) {
  Random random(4);
  StateSpace m = random_model(random, 3, 0, 2, 3);
  FilterBank bank = filter_bank(m, 3), alone = filter_bank(m, 1);
  set_noise(bank, 0, m);
  set_noise(alone, 0, m);
  m.R.setZero();
  m.Q.setZero();
  m.S.setZero();
  set_noise(bank, 1, m);
  m.R.setConstant(1e308);
  set_noise(bank, 2, m);
  VectorXd density(3), single(1);
  for (int t = 0; t < 10; ++t) {
    const VectorXd y = random.normal(2), none;
    step(bank, y, none, density);
    step(alone, y, none, single);
    EXPECT_EQ(density[0], single[0]);
    EXPECT_EQ(density[1], -std::numeric_limits<double>::infinity());
    EXPECT_EQ(density[2], -std::numeric_limits<double>::infinity());
  }
}

TEST(FilterBank, MembersMoveBetweenBanks) {
  Random random(5);
  const StateSpace m = random_model(random, 3, 0, 2, 3);
  FilterBank few = filter_bank(m, 2), many = filter_bank(m, 70);
  set_noise(few, 1, m);
  set_state(few, 1, m.x0, m.P0);
  copy_member(few, 1, many, 66);
  VectorXd a(2), b(70);
  const VectorXd y = random.normal(2), none;
  step(few, y, none, a);
  step(many, y, none, b);
  EXPECT_EQ(a[1], b[66]);
}

TEST(FilterBank, StiffNoiseStaysDefinite) {
  // A measurement a million times more exact than the state, over many samples.
  StateSpace m;
  m.A = (MatrixXd(2, 2) << 1.0, 1.0, 0.0, 1.0).finished();
  m.B.resize(2, 0);
  m.C = (MatrixXd(1, 2) << 1.0, 0.0).finished();
  m.D.resize(1, 0);
  m.G = MatrixXd::Identity(2, 2);
  m.Q = 1e-6 * MatrixXd::Identity(2, 2);
  m.S = MatrixXd::Zero(2, 1);
  m.R = MatrixXd::Constant(1, 1, 1e-12);
  FilterBank bank = filter_bank(m, 1);
  set_noise(bank, 0, m);
  set_state(bank, 0, VectorXd::Zero(2), 1e9 * MatrixXd::Identity(2, 2));
  VectorXd density(1);
  Random random(1);
  double position = 0.0, speed = 0.0;
  for (int t = 0; t < 100000; ++t) {
    step(bank, VectorXd::Constant(1, position), VectorXd(), density);
    ASSERT_TRUE(std::isfinite(density[0])) << t;
    position += speed + 1e-3 * random.normal();
    speed += 1e-3 * random.normal();
  }
}

}  // namespace
}  // namespace identikal
