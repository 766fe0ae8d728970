// The expected information against the textbook formula for the joint Gaussian density of a short
// record, and against published bounds.
#include "lib/filter/information.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <stdexcept>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <gtest/gtest.h>

#include "lib/base/random.h"
#include "lib/filter/steady_state.h"
#include "tests/support/joint_density.h"
#include "tests/support/random_model.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// J_ij = dm_i' V^-1 dm_j + 1/2 tr(V^-1 dV_i V^-1 dV_j) of y stacked ~ N(m, V), by differences.
MatrixXd joint_information(const StateSpace& m, InitialState initial, const MatrixXd& u, Index N,
                           const std::vector<StateSpace>& directions) {
  const auto joint = [&](const StateSpace& at) {
    if (initial == InitialState::given) return stack(at, u, N, at.x0, at.P0);
    const MatrixXd P = *solve_discrete_lyapunov(at.A, at.G * at.Q * at.G.transpose());
    return stack(at, u, N, VectorXd::Zero(at.states()), P);
  };
  const Eigen::LLT<MatrixXd> V(joint(m).covariance);
  std::vector<VectorXd> mean;
  std::vector<MatrixXd> relative;
  const double h = 1e-5;
  for (const StateSpace& d : directions) {
    const Stacked up = joint(moved(m, d, h)), down = joint(moved(m, d, -h));
    mean.emplace_back((up.mean - down.mean) / (2.0 * h));
    relative.emplace_back(V.solve((up.covariance - down.covariance) / (2.0 * h)));
  }
  const auto k = static_cast<Index>(directions.size());
  MatrixXd J(k, k);
  for (Index i = 0; i < k; ++i) {
    for (Index j = 0; j < k; ++j) {
      const auto a = static_cast<std::size_t>(i), b = static_cast<std::size_t>(j);
      J(i, j) = mean[a].dot(V.solve(mean[b])) + 0.5 * (relative[a] * relative[b]).trace();
    }
  }
  return J;
}

TEST(ExpectedInformation, EqualsThatOfTheJointDensityOfAShortRecord) {
  double worst = 0.0;
  for (std::uint64_t seed = 1; seed <= 24; ++seed) {
    Random random(seed);
    const auto n = static_cast<Index>(1 + seed % 3), ny = static_cast<Index>(1 + seed % 2);
    const Index nu = seed % 4 == 0 ? 1 : 0, N = 24 / ny;
    const StateSpace m = random_model(random, n, nu, ny, 2);
    const std::vector<StateSpace> directions = {
        random_direction(random, m), noise_direction(random, m), random_direction(random, m)};
    const MatrixXd u = random_matrix(random, nu, N);
    for (const InitialState initial : {InitialState::given, InitialState::stationary}) {
      const ExpectedInformation info = expected_information(m, initial, N, directions, u);
      ASSERT_EQ(info.status, FilterStatus::ok);
      const MatrixXd expected = joint_information(m, initial, u, N, directions);
      worst = std::max(worst, (info.total - expected).norm() / expected.norm());
    }
  }
  std::printf("expected information, 48 short records: %.1e of the joint density's\n", worst);
  EXPECT_LT(worst, 1e-6);
}

// Noise alone takes a recursion of its own, backwards.
TEST(ExpectedInformation, OfNoiseAloneEqualsThatOfTheJointDensity) {
  double worst = 0.0, against_general = 0.0;
  for (std::uint64_t seed = 1; seed <= 24; ++seed) {
    Random random(seed);
    const auto n = static_cast<Index>(1 + seed % 3), ny = static_cast<Index>(1 + seed % 2);
    const Index N = 24 / ny;
    const StateSpace m = random_model(random, n, 0, ny, 2);
    std::vector<StateSpace> directions = {noise_direction(random, m), noise_direction(random, m)};
    for (const InitialState initial : {InitialState::given, InitialState::stationary}) {
      const ExpectedInformation info =
          expected_information(m, initial, N, directions, MatrixXd(0, 0));
      ASSERT_EQ(info.status, FilterStatus::ok);
      const MatrixXd expected = joint_information(m, initial, MatrixXd(0, N), N, directions);
      worst = std::max(worst, (info.total - expected).norm() / expected.norm());
    }
    // Another direction, of A, makes it the general recursion.
    std::vector<StateSpace> more = directions;
    more.push_back(random_direction(random, m));
    for (const InitialState initial :
         {InitialState::given, InitialState::stationary, InitialState::diffuse}) {
      for (const Index samples : {N, Index{3000}}) {
        const ExpectedInformation some =
            expected_information(m, initial, samples, directions, MatrixXd(0, 0));
        const MatrixXd all = expected_information(m, initial, samples, more, MatrixXd(0, 0))
                                 .total.topLeftCorner(2, 2);
        against_general = std::max(against_general, (some.total - all).norm() / all.norm());
      }
    }
  }
  std::printf(
      "expected information about noise: %.1e of the joint density's, %.1e of the general "
      "recursion\n",
      worst, against_general);
  EXPECT_LT(worst, 1e-6);
  EXPECT_LT(against_general, 1e-9);
}

// A finite error of the gain, its filter's prediction error exactly: what remains is of third
// order.
TEST(ExpectedFilterLoss, IsTheSecondOrderOfTheExactLoss) {
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    Random random(seed);
    const auto n = static_cast<Index>(1 + seed % 4), ny = static_cast<Index>(1 + seed % 2);
    const StateSpace m = random_model(random, n, 0, ny, 2);
    const std::vector<StateSpace> d = {noise_direction(random, m), noise_direction(random, m)};
    const auto gain = steady_gain_sensitivity(m, d);
    ASSERT_TRUE(gain.has_value());
    // Errors of +-h along either direction, equally likely.
    const auto loss = [&](double h) {
      double sum = 0.0;
      for (const StateSpace& one : d) {
        for (const double by : {h, -h}) {
          const MatrixXd K = steady_state(moved(m, one, by))->K;
          const MatrixXd cross = m.G * m.S * K.transpose();
          const MatrixXd P = *solve_discrete_lyapunov(
              m.A - K * m.C,
              m.G * m.Q * m.G.transpose() + K * m.R * K.transpose() - cross - cross.transpose());
          sum += 0.25 * (P.trace() / gain->P.trace() - 1.0);
        }
      }
      return sum;
    };
    const double h = 1e-3 * m.R.norm() / d[0].R.norm();
    const auto expected = expected_filter_loss(m, *gain, 0.5 * h * h * MatrixXd::Identity(2, 2));
    ASSERT_TRUE(expected.has_value());
    EXPECT_NEAR(loss(h) / *expected, 1.0, 0.01) << seed;
  }
}

TEST(ExpectedInformation, LongRecordsGrowByTheSteadyRate) {
  Random random(5);
  const StateSpace m = random_model(random, 3, 0, 2, 3);
  const std::vector<StateSpace> d = {noise_direction(random, m), random_direction(random, m)};
  const MatrixXd none(0, 0);
  const ExpectedInformation one =
      expected_information(m, InitialState::stationary, 100000, d, none);
  const ExpectedInformation two =
      expected_information(m, InitialState::stationary, 200000, d, none);
  EXPECT_TRUE((two.total - one.total).isApprox(1e5 * one.per_sample, 1e-9));
  const ExpectedInformation diffuse =
      expected_information(m, InitialState::diffuse, 100000, d, none);
  EXPECT_TRUE(diffuse.total.isApprox(one.total, 1e-3));
}

// K (n x ny) and the lower triangle of Sigma as directions of the innovation form.
std::vector<StateSpace> innovation_directions(const StateSpace& form) {
  const Index n = form.states(), ny = form.outputs();
  StateSpace none = form;
  none.A.setZero(), none.B.setZero(), none.C.setZero(), none.D.setZero(), none.G.setZero();
  none.Q.setZero(), none.R.setZero(), none.S.setZero(), none.x0.setZero(), none.P0.setZero();
  std::vector<StateSpace> out;
  for (Index j = 0; j < ny; ++j) {
    for (Index i = 0; i < n; ++i) {
      out.push_back(none);
      out.back().G(i, j) = 1.0;
    }
  }
  for (Index j = 0; j < ny; ++j) {
    for (Index i = j; i < ny; ++i) {
      out.push_back(none);
      StateSpace& d = out.back();
      d.Q(i, j) = d.Q(j, i) = 1.0;
      d.R = d.S = d.Q;
    }
  }
  return out;
}

// x+ = A x + K e, y = C x + e as a model of its own: one noise, in both equations.
StateSpace innovation_form(const StateSpace& m, const MatrixXd& K, const MatrixXd& Sigma) {
  StateSpace out = m;
  out.B.resize(m.states(), 0);
  out.D.resize(m.outputs(), 0);
  out.G = K;
  out.Q = out.R = out.S = Sigma;
  out.x0 = VectorXd::Zero(m.states());
  out.P0 = MatrixXd::Zero(m.states(), m.states());
  return out;
}

TEST(InnovationForm, EqualsWhatTheJointDensityOfAShortRecordGains) {
  double worst = 0.0;
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    Random random(seed);
    const auto n = static_cast<Index>(1 + seed % 3), ny = static_cast<Index>(1 + seed % 2);
    const StateSpace m = random_model(random, n, 0, ny, 2);
    // Any gain will do whose filter forgets within the record: F = A - K C of radius 0.3 at most.
    MatrixXd K = random_matrix(random, n, ny);
    const MatrixXd F = m.A - K * m.C;
    const double shrink = std::min(1.0, 0.3 / F.eigenvalues().cwiseAbs().maxCoeff());
    StateSpace form = m;
    form.A *= shrink;
    K *= shrink;
    form = innovation_form(form, K, m.R);
    const auto J = innovation_form_information(form.A, form.C, K, m.R);
    ASSERT_TRUE(J);
    const auto directions = innovation_directions(form);
    constexpr Index kLong = 48;
    const auto of = [&](Index N) {
      return joint_information(form, InitialState::given, MatrixXd(0, N), N, directions);
    };
    const MatrixXd gained = (of(kLong) - of(kLong / 2)) / (kLong / 2.0);
    worst = std::max(worst, (*J - gained).norm() / gained.norm());
  }
  std::printf("innovation form, 12 short records: %.1e of the joint density's\n", worst);
  EXPECT_LT(worst, 1e-6);
}

TEST(InnovationForm, CarriesAllThatOutputsSayOfTheNoise) {
  double worst = 0.0;
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    Random random(seed);
    const auto n = static_cast<Index>(1 + seed % 3), ny = static_cast<Index>(1 + seed % 2);
    const StateSpace m = random_model(random, n, 0, ny, 2);
    const std::vector<StateSpace> d = {noise_direction(random, m), noise_direction(random, m)};
    const auto gain = steady_gain_sensitivity(m, d);
    ASSERT_TRUE(gain);
    const auto J = innovation_form_information(m.A, m.C, gain->K, gain->Sigma);
    ASSERT_TRUE(J);
    MatrixXd T(J->rows(), 2);
    for (Index i = 0; i < 2; ++i) {
      const auto at = static_cast<std::size_t>(i);
      T.col(i).head(n * ny) = gain->K_theta[at].reshaped();
      for (Index c = 0, row = n * ny; c < ny; ++c) {
        for (Index r = c; r < ny; ++r) T(row++, i) = gain->Sigma_theta[at](r, c);
      }
    }
    const MatrixXd expected =
        expected_information(m, InitialState::stationary, 100000, d, MatrixXd()).per_sample;
    ASSERT_GT(expected.size(), 0);
    worst = std::max(worst, (T.transpose() * *J * T - expected).norm() / expected.norm());
  }
  std::printf("innovation form carried over to the noise: %.1e of its information\n", worst);
  EXPECT_LT(worst, 1e-9);
}

// (6.45) knows Sigma as well as outputs do, k better than they do where noise makes the gain of a
// stable system, and where it does not, (6.45) can exceed what outputs tell.
TEST(InnovationForm, ThePublishedOneIsNotReached) {
  const auto deviations = [](double a, double k, double Sigma) {
    const auto one = [](double x) { return MatrixXd::Constant(1, 1, x); };
    const MatrixXd J = *innovation_form_information(one(a), one(1.0), one(k), one(Sigma));
    const Eigen::Matrix2d published = published_innovation_information(k, Sigma).inverse();
    EXPECT_NEAR(J(0, 0) * (1.0 - std::pow(a - k, 2)), 1.0, 1e-12);
    EXPECT_NEAR(1.0 / J(1, 1), 2.0 * Sigma * Sigma, 1e-12);
    EXPECT_NEAR(published(0, 0), k * k, 1e-12);
    EXPECT_NEAR(published(1, 1), 2.0 * Sigma * Sigma, 1e-12);
    return std::pair{std::sqrt(1.0 / J(0, 0)), std::sqrt(published(0, 0))};
  };
  for (const double a : {-0.9, -0.5, 0.1, 0.5, 0.99}) {
    for (const double share : {0.05, 0.5, 0.95}) {  // of a, as q / r goes from 0 to infinity
      const auto [outputs, published] = deviations(a, share * a, 2.0);
      EXPECT_LT(published, outputs) << a << " " << share;
    }
  }
  const auto [outputs, published] = deviations(2.0, 1.8, 2.0);
  EXPECT_GT(published, outputs);
  EXPECT_THROW(published_innovation_information(0.0, 1.0), std::invalid_argument);
  EXPECT_THROW(published_innovation_information(0.5, 0.0), std::invalid_argument);
  const MatrixXd one = MatrixXd::Ones(1, 1);
  EXPECT_FALSE(innovation_form_information(2.0 * one, one, 0.5 * one, one));
  EXPECT_FALSE(innovation_form_information(one, one, 0.5 * one, -one));
  EXPECT_THROW(innovation_form_information(one, one, MatrixXd::Ones(2, 1), one),
               std::invalid_argument);
}

// The source's (6.47) and, with the inverse that it lacks, (6.48): the information about the next
// state is the inverse of the filter's predicted covariance.
TEST(StateInformation, NeedsTheInverseThatThePublishedRecursionLacks) {
  Random random(7);
  StateSpace m = random_model(random, 2, 0, 1, 2);
  m.S.setZero();
  m.G = MatrixXd::Identity(2, 2);
  const Index N = 8;
  const FilterResult filter =
      kalman_filter(m, InitialState::given, random_matrix(random, 1, N), MatrixXd(0, N));
  const MatrixXd Qi = m.Q.inverse(), K12 = -m.A.transpose() * Qi, K11 = m.A.transpose() * Qi * m.A;
  const MatrixXd L = m.C.transpose() * m.R.inverse() * m.C;
  MatrixXd J = m.P0.inverse();
  for (Index t = 0; t + 1 < N; ++t) {
    const MatrixXd next = filter.P_pred[static_cast<std::size_t>(t + 1)].inverse();
    const MatrixXd as_printed = Qi - K12.transpose() * (J + K11 + L) * K12;
    J = Qi - K12.transpose() * (J + K11 + L).inverse() * K12;
    EXPECT_LT((J - next).norm(), 1e-9 * next.norm());
    EXPECT_GT((as_printed - next).norm(), 0.1 * next.norm());
  }
}

TEST(ExpectedInformation, SaysWhatCannotBe) {
  Random random(6);
  StateSpace m = random_model(random, 2, 1, 1, 2);
  const std::vector<StateSpace> d = {noise_direction(random, m)};
  EXPECT_THROW(expected_information(m, InitialState::stationary, 10, d, MatrixXd(1, 9)),
               std::invalid_argument);
  EXPECT_THROW(expected_information(m, InitialState::stationary, 0, d, MatrixXd(1, 0)),
               std::invalid_argument);
  m.A *= 2.0;
  const MatrixXd u = MatrixXd::Zero(1, 10);
  EXPECT_EQ(expected_information(m, InitialState::stationary, 10, d, u).status,
            FilterStatus::unstable);
  EXPECT_EQ(expected_information(m, InitialState::diffuse, 10, d, u).status, FilterStatus::ok);
  m.R.setZero(), m.Q.setZero(), m.S.setZero(), m.P0.setZero();
  EXPECT_EQ(expected_information(m, InitialState::given, 10, d, u).status,
            FilterStatus::indefinite);
}

}  // namespace
}  // namespace identikal
