#include "lib/filter/likelihood.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "lib/base/constants.h"
#include "lib/base/random.h"
#include "lib/filter/kalman.h"
#include "lib/filter/steady_state.h"
#include "tests/support/joint_density.h"
#include "tests/support/random_model.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr InitialState kStarts[] = {InitialState::given, InitialState::stationary,
                                    InitialState::diffuse};

struct LikelihoodCase {
  StateSpace model;
  MatrixXd y, u;
  std::vector<StateSpace> derivatives;
};

LikelihoodCase random_case(std::uint64_t seed, Index N, bool dynamics) {
  Random random(seed);
  const auto pick = [&](int from, int to) {
    return static_cast<Index>(from + static_cast<int>(random.uniform() * (to - from + 1)));
  };
  LikelihoodCase out;
  const Index n = pick(1, 7), nu = pick(0, 2), ny = pick(1, 3), nw = pick(1, static_cast<int>(n));
  out.model = random_model(random, n, nu, ny, nw);
  out.u = random_matrix(random, nu, N);
  if (nu > 0) out.u.row(0).array() += 5.0;
  out.y = simulate_outputs(random, out.model, out.u, N);
  for (int i = 0; i < 4; ++i) {
    out.derivatives.push_back(dynamics ? random_direction(random, out.model)
                                       : noise_direction(random, out.model));
  }
  return out;
}

void knock_out(MatrixXd& y, Index begin, Index rows, Index channel) {
  for (Index t = begin; t < begin + rows; ++t) {
    for (Index i = 0; i < y.rows(); ++i) {
      if (channel < 0 || channel == i) y(i, t) = kNaN;
    }
  }
}

double relative(const MatrixXd& a, const MatrixXd& b) {
  return (a - b).cwiseAbs().maxCoeff() / std::max(1e-300, b.cwiseAbs().maxCoeff());
}

// value, gradient, information
struct Differences {
  double value = 0.0, gradient = 0.0, information = 0.0;
};
Differences compare(const LikelihoodCase& c, InitialState initial, EvaluationMethod method,
                    EvaluationMethod* taken) {
  LikelihoodEngine engine;
  engine.add_recording(c.y, c.u);
  const Likelihood fast = engine.evaluate(c.model, initial, c.derivatives, method);
  *taken = engine.evaluation_taken().method;
  LikelihoodEngine reference;
  reference.add_recording(c.y, c.u);
  const Likelihood full =
      reference.evaluate(c.model, initial, c.derivatives, EvaluationMethod::time_varying);
  EXPECT_EQ(fast.status, full.status);
  if (full.status != FilterStatus::ok) {
    // A state that is forgotten before it is seen.
    EXPECT_EQ(full.status, FilterStatus::undetermined);
    return {};
  }
  return {std::abs(fast.value / full.value - 1.0), relative(fast.gradient, full.gradient),
          relative(fast.information, full.information)};
}

TEST(Likelihood, PathsAgree) {
  Differences worst[3];
  int compressed = 0;
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    const LikelihoodCase c = random_case(seed, 2000, seed % 2 == 0);
    for (const InitialState initial : kStarts) {
      for (const EvaluationMethod method :
           {EvaluationMethod::steady_state, EvaluationMethod::automatic}) {
        EvaluationMethod taken;
        const Differences d = compare(c, initial, method, &taken);
        compressed += taken == EvaluationMethod::autocovariances;
        Differences& w = worst[static_cast<int>(taken) - 1];
        w = {std::max(w.value, d.value), std::max(w.gradient, d.gradient),
             std::max(w.information, d.information)};
        EXPECT_LT(d.value, 1e-10) << seed << " " << to_string(taken);
        EXPECT_LT(d.gradient, 1e-8) << seed << " " << to_string(taken);
      }
    }
  }
  EXPECT_GT(compressed, 25);
  for (const EvaluationMethod method :
       {EvaluationMethod::steady_state, EvaluationMethod::autocovariances}) {
    const Differences& w = worst[static_cast<int>(method) - 1];
    printf("%s: value %.1e, gradient %.1e, information %.1e of the full recursion's\n",
           to_string(method), w.value, w.gradient, w.information);
  }
}

TEST(Likelihood, GapsSplitTheRecordingIntoSegments) {
  Differences worst;
  int compressed = 0;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    LikelihoodCase c = random_case(seed, 3000, seed % 2 == 0);
    knock_out(c.y, 0, 3, -1);
    knock_out(c.y, 700, 5, -1);
    knock_out(c.y, 1500, 40, c.y.rows() - 1);
    knock_out(c.y, 1570, 1, 0);
    knock_out(c.y, 2999, 1, -1);
    for (const InitialState initial : kStarts) {
      EvaluationMethod taken;
      const Differences d = compare(c, initial, EvaluationMethod::automatic, &taken);
      compressed += taken == EvaluationMethod::autocovariances;
      worst.value = std::max(worst.value, d.value);
      worst.gradient = std::max(worst.gradient, d.gradient);
      EXPECT_LT(d.value, 1e-10) << seed;
      EXPECT_LT(d.gradient, 1e-8) << seed;
    }
  }
  EXPECT_GT(compressed, 15);
  printf("with gaps: value %.1e, gradient %.1e of the full recursion's\n", worst.value,
         worst.gradient);
}

TEST(Likelihood, CompressedEqualsTheJointDensityOfAShortRecord) {
  double worst = 0.0;
  int compressed = 0;
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    LikelihoodCase c = random_case(seed, 3, false);
    c.model.A *= 0.03;  // forgotten within the record
    const Index n = c.model.states(), ny = c.model.outputs(), N = 60 / ny;
    if (N < 40) continue;
    Random random(seed);
    const MatrixXd u = random_matrix(random, c.model.inputs(), N),
                   y = 3.0 * random_matrix(random, ny, N);
    LikelihoodEngine engine;
    engine.add_recording(y, u);
    for (const InitialState initial : kStarts) {
      if (initial == InitialState::diffuse && n > ny) continue;  // forgotten before it is seen
      const Likelihood l = engine.evaluate(c.model, initial);
      if (engine.evaluation_taken().method != EvaluationMethod::autocovariances) continue;
      ASSERT_EQ(l.status, FilterStatus::ok);
      ++compressed;
      VectorXd x0 = VectorXd::Zero(n);
      MatrixXd P0 = MatrixXd::Zero(n, n);
      if (initial == InitialState::given) x0 = c.model.x0, P0 = c.model.P0;
      if (initial == InitialState::stationary) {
        P0 = *solve_discrete_lyapunov(c.model.A, c.model.G * c.model.Q * c.model.G.transpose());
      }
      const Stacked stacked = stack(c.model, u, N, x0, P0);
      const double expected = initial == InitialState::diffuse ? diffuse_log_density(stacked, y)
                                                               : joint_log_density(stacked, y);
      worst = std::max(worst, std::abs(l.value / expected - 1.0));
      EXPECT_LT(std::abs(l.value / expected - 1.0), 1e-9) << seed;
    }
  }
  EXPECT_GT(compressed, 40);
  printf("compressed, %d short records: %.1e of the joint density\n", compressed, worst);
}

TEST(Likelihood, CompressedGradientMatchesDifferences) {
  double worst = 0.0;
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    const LikelihoodCase c = random_case(seed, 2000, seed % 2 == 0);
    LikelihoodEngine engine;
    engine.add_recording(c.y, c.u);
    for (const InitialState initial : kStarts) {
      const Likelihood l = engine.evaluate(c.model, initial, c.derivatives);
      if (engine.evaluation_taken().method != EvaluationMethod::autocovariances) continue;
      VectorXd differences(l.gradient.size());
      for (Index i = 0; i < differences.size(); ++i) {
        const auto at = [&](double h) {
          const StateSpace m = moved(c.model, c.derivatives[static_cast<std::size_t>(i)], h);
          return engine.evaluate(m, initial).value;
        };
        const double h = 1e-4;  // fourth order
        differences[i] = (8.0 * (at(h) - at(-h)) - (at(2.0 * h) - at(-2.0 * h))) / (12.0 * h);
      }
      worst = std::max(worst, relative(l.gradient, differences));
      EXPECT_LT(relative(l.gradient, differences), 1e-6) << seed;
    }
  }
  printf("compressed gradient: %.1e of differences\n", worst);
}

// With 2000 scores a variance is known to 3.2 %; four entries each within five such errors.
TEST(Likelihood, CompressedInformationIsTheCovarianceOfTheScore) {
  for (const bool dynamics : {false, true}) {
    StateSpace m;
    m.A = MatrixXd::Constant(1, 1, 0.5);
    m.B = MatrixXd::Constant(1, 1, 0.3);
    m.C = m.G = MatrixXd::Identity(1, 1);
    m.D = MatrixXd::Zero(1, 1);
    m.Q = MatrixXd::Constant(1, 1, 3.0);
    m.R = MatrixXd::Constant(1, 1, 2.0);
    m.S = MatrixXd::Zero(1, 1);
    m.x0 = VectorXd::Zero(1);
    m.P0 = MatrixXd::Zero(1, 1);
    StateSpace zero = m;
    zero.A.setZero(), zero.B.setZero(), zero.C.setZero(), zero.G.setZero(), zero.Q.setZero();
    zero.R.setZero();
    std::vector<StateSpace> d(2, zero);
    if (dynamics) {
      d[0].A(0, 0) = d[1].B(0, 0) = 1.0;
    } else {
      d[0].Q(0, 0) = d[1].R(0, 0) = 1.0;
    }
    const Index N = 500;
    const int runs = 2000;
    Random random(11);
    const MatrixXd u = random_matrix(random, 1, N);
    MatrixXd scores(2, runs), information = MatrixXd::Zero(2, 2);
    for (int run = 0; run < runs; ++run) {
      const MatrixXd y = simulate_outputs(random, m, u, N);
      LikelihoodEngine engine;
      engine.add_recording(y, u);
      const Likelihood l = engine.evaluate(m, InitialState::given, d);
      ASSERT_EQ(engine.evaluation_taken().method, EvaluationMethod::autocovariances);
      scores.col(run) = l.gradient;
      information += l.information / runs;
    }
    const MatrixXd covariance = scores * scores.transpose() / runs;
    for (int i = 0; i < 2; ++i) {
      for (int j = 0; j < 2; ++j) {
        const double scale = std::sqrt(information(i, i) * information(j, j));
        EXPECT_NEAR(covariance(i, j) / scale, information(i, j) / scale, 0.16);
      }
    }
    printf("information / covariance of 2000 scores: %.3f %.3f\n",
           information(0, 0) / covariance(0, 0), information(1, 1) / covariance(1, 1));
  }
}

TEST(Likelihood, SlowFiltersFallBackAndSaySo) {
  // A random walk seen through much noise: the pole is 1 - 1e-3.
  StateSpace m;
  m.A = m.C = m.G = m.R = MatrixXd::Identity(1, 1);
  m.B.resize(1, 0), m.D.resize(1, 0);
  m.Q = MatrixXd::Constant(1, 1, 1e-6);
  m.S = MatrixXd::Zero(1, 1);
  Random random(1);
  const MatrixXd y = random_matrix(random, 1, 50000), u(0, 50000);
  LikelihoodEngine engine;
  engine.add_recording(y, u);
  const Likelihood l = engine.evaluate(m, InitialState::diffuse);
  EXPECT_EQ(l.status, FilterStatus::ok);
  EXPECT_EQ(engine.evaluation_taken().method, EvaluationMethod::steady_state);
  EXPECT_EQ(engine.evaluation_taken().fallback, FallbackReason::long_memory);
  EXPECT_NEAR(engine.evaluation_taken().pole, 0.999, 1e-5);
  EXPECT_NEAR(l.value, log_likelihood(m, InitialState::diffuse, y, u).value, 1e-6);
}

TEST(Likelihood, RecordingsAddUp) {
  const LikelihoodCase c = random_case(5, 1500, true);
  LikelihoodEngine both;
  Likelihood sum = log_likelihood(c.model, InitialState::stationary, c.y, c.u, c.derivatives);
  const MatrixXd y2 = c.y.leftCols(900), u2 = c.u.leftCols(900);
  const Likelihood second =
      log_likelihood(c.model, InitialState::stationary, y2, u2, c.derivatives);
  both.add_recording(c.y, c.u);
  both.add_recording(y2, u2);
  const Likelihood l = both.evaluate(c.model, InitialState::stationary, c.derivatives);
  EXPECT_NEAR(l.value, sum.value + second.value, 1e-9 * std::abs(l.value));
  EXPECT_LT(relative(l.gradient, sum.gradient + second.gradient), 1e-8);
}

// A scalar system, started at x0 with variance P0.
StateSpace scalar(double a, double Q, double R, double x0, double P0) {
  StateSpace m;
  const auto one = [](double v) { return MatrixXd::Constant(1, 1, v); };
  m.A = one(a), m.C = one(1), m.G = one(1), m.Q = one(Q), m.R = one(R), m.S = one(0);
  m.B.resize(1, 0), m.D.resize(1, 0);
  m.x0 = VectorXd::Constant(1, x0);
  m.P0 = one(P0);
  return m;
}

StateSpace zero_like(const StateSpace& m) {
  StateSpace d = m;
  for (MatrixXd* M : {&d.A, &d.B, &d.C, &d.D, &d.G, &d.Q, &d.R, &d.S, &d.P0}) M->setZero();
  d.x0.setZero();
  return d;
}

// Automatic against direct: value, gradient, information.
void expect_same(const StateSpace& m, InitialState initial, const MatrixXd& y, const MatrixXd& u,
                 const std::vector<StateSpace>& derivatives, double information_tolerance,
                 double gradient_tolerance = 1e-6) {
  LikelihoodEngine engine;
  engine.add_recording(y, u);
  const Likelihood direct =
      engine.evaluate(m, initial, derivatives, EvaluationMethod::time_varying);
  ASSERT_EQ(direct.status, FilterStatus::ok);
  const Likelihood automatic = engine.evaluate(m, initial, derivatives);
  ASSERT_EQ(automatic.status, FilterStatus::ok);
  EXPECT_NEAR(automatic.value, direct.value, 1e-9 * std::abs(direct.value));
  EXPECT_LT(relative(automatic.gradient, direct.gradient), gradient_tolerance);
  EXPECT_LT(relative(automatic.information, direct.information), information_tolerance);
}

TEST(Likelihood, AStartThatIsEstimated) {
  Random random(1);
  const StateSpace m = scalar(0.9, 1.0, 1.0, 2.0, 0.1);
  const MatrixXd y = simulate_outputs(random, m, MatrixXd(0, 500), 500), u(0, 500);
  StateSpace by_x0 = zero_like(m), by_P0 = by_x0;
  by_x0.x0.setOnes();
  by_P0.P0.setOnes();
  expect_same(m, InitialState::given, y, u, {by_x0, by_P0}, 1e-6);
}

// A pendulum that is let go of tells more of its frequency and damping by the swing from where it
// was than by the noise that keeps it going; behind a gap the swing starts from where the filter
// is.
TEST(Likelihood, ASwingFromAKnownStartIsInformation) {
  StateSpace m;
  m.A = MatrixXd{{0.97, 0.049}, {-1.2, 0.95}};
  m.B = MatrixXd(2, 0);
  m.C = MatrixXd{{1.0, 0.0}};
  m.D = MatrixXd(1, 0);
  m.G = MatrixXd{{0.0}, {1.0}};
  m.Q = MatrixXd::Constant(1, 1, 5e-4);
  m.R = MatrixXd::Constant(1, 1, 1e-5);
  m.S = MatrixXd::Zero(1, 1);
  m.x0 = VectorXd::Zero(2);
  m.P0 = Eigen::Vector2d(1e-4, 1e-2).asDiagonal();
  std::vector<StateSpace> d(3, zero_like(m));
  d[0].A(1, 0) = d[1].A(1, 1) = d[2].Q(0, 0) = 1.0;
  const Index N = 2000;
  for (const double swing : {0.0, 0.3, 3.0}) {
    m.x0 = Eigen::Vector2d(swing, 0.0);
    Random random(5);
    MatrixXd y = simulate_outputs(random, m, MatrixXd(0, N), N);
    const MatrixXd u(0, N);
    for (const bool gap : {false, true}) {
      SCOPED_TRACE(swing);
      if (gap) knock_out(y, 20, 3, -1);
      LikelihoodEngine engine;
      engine.add_recording(y, u);
      const MatrixXd direct =
          engine.evaluate(m, InitialState::given, d, EvaluationMethod::time_varying).information;
      const MatrixXd compressed = engine.evaluate(m, InitialState::given, d).information;
      ASSERT_EQ(engine.evaluation_taken().method, EvaluationMethod::autocovariances);
      const VectorXd scale = direct.diagonal().cwiseSqrt().cwiseInverse();
      const MatrixXd error = scale.asDiagonal() * (compressed - direct) * scale.asDiagonal();
      printf("swing %.1f%s: information %.1e of the full recursion's apart\n", swing,
             gap ? ", gap" : "", error.cwiseAbs().maxCoeff());
      EXPECT_LT(error.cwiseAbs().maxCoeff(), 0.01);
    }
  }
}

TEST(Likelihood, AStartKnownMuchBetterThanTheSteadyState) {
  for (const auto& [a, Q, R] :
       {std::tuple{1.5, 1e-20, 1.0}, std::tuple{1.2, 1e-16, 1.0}, std::tuple{1.5, 1e-12, 1.0},
        std::tuple{0.5, 1.0, 1e-10}, std::tuple{0.5, 1.0, 1e-4}, std::tuple{0.5, 1.0, 1.0}}) {
    Random random(2);
    const StateSpace m = scalar(a, Q, R, 0.0, 0.0);
    // Not this model's own output: that of an unstable one would overflow.
    const MatrixXd y = random_matrix(random, 1, 150), u(0, 150);
    StateSpace by_R = zero_like(m);
    by_R.R.setOnes();
    expect_same(m, InitialState::given, y, u, {by_R}, 0.2);
  }
}

TEST(Likelihood, CancellationIsSeen) {
  for (const double s : {1e1, 1e3, 1e4, 1e6}) {
    SCOPED_TRACE(s);
    // Two states driven hard by one input, of which the output sees the difference.
    Random random(3);
    StateSpace m = random_model(random, 2, 1, 1, 2);
    m.A << 0.9, 0, 0, 0.9 + 0.1 / s;
    m.B << s, s;
    m.C << 1, -1;
    m.D.setZero(), m.S.setZero();
    m.G.setIdentity(), m.Q.setIdentity(), m.R.setIdentity();
    m.x0.setZero();
    const MatrixXd u = random_matrix(random, 1, 2000);
    const MatrixXd y = simulate_outputs(random, m, u, 2000);
    expect_same(m, InitialState::stationary, y, u, {noise_direction(random, m)}, 0.2);
  }
  for (const double R : {1e-2, 1e-4, 1e-6, 1e-8}) {
    SCOPED_TRACE(R);
    // Two sensors of one state: nearly copies of each other.
    Random random(4);
    StateSpace m = random_model(random, 1, 1, 2, 1);
    m.A << 0.5;
    m.B << 1;
    m.C << 1, 1.3;
    m.D.setZero(), m.S.setZero();
    m.G.setOnes(), m.Q.setOnes();
    m.R = R * MatrixXd::Identity(2, 2);
    m.x0.setZero();
    const MatrixXd u = 100.0 * random_matrix(random, 1, 2000);
    const MatrixXd y = simulate_outputs(random, m, u, 2000);
    StateSpace by_Q = zero_like(m);
    by_Q.Q.setOnes();
    // At 1e-8 the condition of Sigma, 4e8, takes half of all digits by every method.
    expect_same(m, InitialState::stationary, y, u, {by_Q}, 0.2, R < 1e-7 ? 1e-5 : 1e-6);
  }
}

TEST(Likelihood, AVarianceAtZeroStillHasADerivative) {
  Random random(5);
  StateSpace m = random_model(random, 2, 0, 2, 2);
  m.A << 0.1, 0, 0, 0.999;
  m.C.setIdentity(), m.G.setIdentity(), m.R.setIdentity(), m.S.setZero();
  m.Q << 0, 0, 0, 1e-4;
  m.x0.setZero();
  m.P0 = MatrixXd::Zero(2, 2);
  m.P0(1, 1) = steady_state(scalar(0.999, 1e-4, 1.0, 0, 0))->P(0, 0);
  const MatrixXd y = random_matrix(random, 2, 3000), u(0, 3000);
  StateSpace by_Q = zero_like(m);
  by_Q.Q.setIdentity();
  LikelihoodEngine engine;
  engine.add_recording(y, u);
  const Likelihood direct =
      engine.evaluate(m, InitialState::given, {by_Q}, EvaluationMethod::time_varying);
  const Likelihood steady =
      engine.evaluate(m, InitialState::given, {by_Q}, EvaluationMethod::steady_state);
  EXPECT_LT(relative(steady.gradient, direct.gradient), 1e-9);
  EXPECT_LT(relative(steady.information, direct.information), 1e-9);
}

TEST(Likelihood, DiffuseStartsDoNotDependOnTheUnitsOfTheStates) {
  Random random(6);
  StateSpace m = random_model(random, 2, 0, 1, 2);
  m.A << 1, 1, 0, 0.9;
  m.C << 1, 0;
  m.G.setIdentity(), m.Q.setIdentity(), m.R.setIdentity(), m.S.setZero();
  m.x0.setZero();
  const MatrixXd y = simulate_outputs(random, m, MatrixXd(0, 300), 300), u(0, 300);
  const double expected = log_likelihood(m, InitialState::diffuse, y, u).value;
  for (const double unit : {1e-8, 1e-6, 1e-3, 1e3, 1e6, 1e8}) {
    StateSpace other = m;  // the second state counted in `unit`
    other.A(0, 1) *= unit;
    other.G(1, 1) /= unit;
    for (const EvaluationMethod method :
         {EvaluationMethod::time_varying, EvaluationMethod::autocovariances}) {
      LikelihoodEngine engine;
      engine.add_recording(y, u);
      const Likelihood l = engine.evaluate(other, InitialState::diffuse, {}, method);
      ASSERT_EQ(l.status, FilterStatus::ok) << unit;
      // A diffuse density is one per unit of the states.
      EXPECT_NEAR(l.value + std::log(unit), expected, 1e-9 * std::abs(expected)) << unit;
    }
  }
}

// Chains of integrators, y = x(1) + v, whose last state white noise enters, from a diffuse start.
// Reference: the dense joint density in 60 digits (mpmath: Cholesky of the covariance that noise
// alone gives y, the start as a regression on the responses to it).
TEST(Likelihood, DiffuseChainsOfIntegratorsKeepTheirDigits) {
  struct Reference {
    Index n;
    double q, log_likelihood;
  };
  MatrixXd y(1, 60);
  for (Index t = 0; t < 60; ++t) {
    const auto T = static_cast<double>(t);
    y(0, t) = static_cast<double>((t * t * 7919 + 31 * t) % 2003 - 1001) / 1000.0 + T * T / 20.0;
  }
  double worst = 0.0;
  for (const Reference& c : {Reference{2, 1, -101.23239352543099},
                             {2, 1e6, -453.94846277480602},
                             {3, 1, -116.32587601749019},
                             {3, 1e6, -446.12227374208742},
                             {4, 1, -132.06379581266216},
                             {4, 1e6, -438.2973648434175},
                             {5, 1, -147.71590902026328},
                             {5, 1e6, -430.47710757248501},
                             {6, 1, -163.07315180870249},
                             {6, 1e6, -422.67392820971108}}) {
    StateSpace model;
    model.A = MatrixXd::Identity(c.n, c.n);
    model.A.diagonal(1).setOnes();
    model.B.setZero(c.n, 0);
    model.C = MatrixXd::Identity(1, c.n);
    model.D.setZero(1, 0);
    model.G = MatrixXd::Identity(c.n, c.n).rightCols(1);
    model.Q.setConstant(1, 1, c.q);
    model.R.setOnes(1, 1);
    model.S.setZero(1, 1);
    const double value = log_likelihood(model, InitialState::diffuse, y, MatrixXd(0, 60)).value;
    const double off = std::abs(value / c.log_likelihood - 1.0);
    std::printf("%d integrators, q %g: %.1e off\n", static_cast<int>(c.n), c.q, off);
    if (c.n <= 4) worst = std::max(worst, off);
    EXPECT_LT(off, 1e-7);
  }
  EXPECT_LT(worst, 1e-9);
}

// A recording of `m` with gaps, and what the automatic choice makes of it against the recursion.
void expect_agreement(const StateSpace& m, InitialState initial, const MatrixXd& y,
                      const std::vector<StateSpace>& derivatives, EvaluationMethod by) {
  const MatrixXd u(0, y.cols());
  LikelihoodEngine engine;
  engine.add_recording(y, u);
  const Likelihood fast = engine.evaluate(m, initial, derivatives);
  EXPECT_EQ(engine.evaluation_taken().method, by);
  const Likelihood full = log_likelihood(m, initial, y, u, derivatives);
  ASSERT_EQ(fast.status, full.status);
  EXPECT_NEAR(fast.value, full.value, 1e-9 * std::abs(full.value));
  // Either rounds terms of the size of the information's root.
  for (Index i = 0; i < full.gradient.size(); ++i) {
    EXPECT_NEAR(fast.gradient[i], full.gradient[i], 1e-7 * std::sqrt(full.information(i, i)));
  }
  const double information = by == EvaluationMethod::autocovariances ? 0.3 : 1e-7;
  EXPECT_LT(relative(fast.information, full.information), information);
}

// Only Q and R are unknown: one variance each.
std::vector<StateSpace> variances_of(const StateSpace& m) {
  std::vector<StateSpace> out;
  for (Index i = 0; i < m.Q.rows(); ++i) {
    out.push_back(zero_like(m));
    out.back().Q(i, i) = 1.0;
  }
  for (Index i = 0; i < m.R.rows(); ++i) {
    out.push_back(zero_like(m));
    out.back().R(i, i) = 1.0;
  }
  return out;
}

// Local linear trend and a dummy season, one output.
StateSpace structural_model(Index season, double level, double slope, double seasonal,
                            double noise) {
  const Index n = 1 + season;
  StateSpace m;
  m.A = MatrixXd::Zero(n, n);
  m.A.topLeftCorner(2, 2) << 1, 1, 0, 1;
  m.A.row(2).rightCols(n - 2).setConstant(-1.0);
  for (Index i = 3; i < n; ++i) m.A(i, i - 1) = 1.0;
  m.C = MatrixXd::Zero(1, n);
  m.C(0, 0) = m.C(0, 2) = 1.0;
  m.G = MatrixXd::Identity(n, 3);
  m.Q = Eigen::Vector3d(level, slope, seasonal).asDiagonal();
  m.R = MatrixXd::Constant(1, 1, noise);
  m.S = MatrixXd::Zero(3, 1);
  m.B.resize(n, 0), m.D.resize(1, 0);
  m.x0 = VectorXd::Zero(n);
  m.P0 = MatrixXd::Zero(n, n);
  return m;
}

TEST(Likelihood, StructuralModelsAgreeWithTheRecursion) {
  Random random(11);
  for (const double slope : {1e-3, 0.0}) {
    const StateSpace m = structural_model(12, 0.1, slope, 0.02, 0.5);
    MatrixXd y = simulate_outputs(random, m, MatrixXd(0, 200), 200);
    y.array() += 300.0;
    expect_agreement(m, InitialState::diffuse, y, variances_of(m), EvaluationMethod::steady_state);
    knock_out(y, 5, 2, 0);
    knock_out(y, 90, 20, 0);
    expect_agreement(m, InitialState::diffuse, y, variances_of(m), EvaluationMethod::steady_state);
  }
}

// From a stationary start without gaps, many states: their covariance is never formed.
TEST(Likelihood, StationaryStartsAgreeWithTheRecursion) {
  for (const std::uint64_t seed : {1, 2, 3, 4, 5, 6}) {
    Random random(seed);
    const Index n = 5 + static_cast<Index>(seed), ny = 1 + static_cast<Index>(seed) % 3;
    const StateSpace m = random_model(random, n, 1, ny, 2);
    const MatrixXd u = random_matrix(random, 1, 80);
    const MatrixXd y = simulate_outputs(random, m, u, 80);
    std::vector<StateSpace> derivatives;
    for (int i = 0; i < 9; ++i) derivatives.push_back(random_direction(random, m));
    LikelihoodEngine fast, full;
    fast.add_recording(y, u);
    full.add_recording(y, u);
    const Likelihood a =
        fast.evaluate(m, InitialState::stationary, derivatives, EvaluationMethod::steady_state);
    const Likelihood b =
        full.evaluate(m, InitialState::stationary, derivatives, EvaluationMethod::time_varying);
    ASSERT_EQ(a.status, FilterStatus::ok);
    EXPECT_NEAR(a.value, b.value, 1e-11 * std::abs(b.value));
    EXPECT_LT(relative(a.gradient, b.gradient), 1e-9) << "states: " << n;
    EXPECT_LT(relative(a.information, b.information), 1e-9) << "states: " << n;
  }
}

// A seasonal moving average on its border, behind an almost integrating autoregression: the noise
// is a ten thousandth of the output, and the start is all but known in directions that last.
TEST(Likelihood, StationaryStartsOfLongChainsAgreeWithTheRecursion) {
  Random random(7);
  StateSpace m = random_model(random, 14, 0, 1, 1);
  m.A.setZero();
  m.A(0, 0) = 0.9999;
  m.A.diagonal(-1).setOnes();
  m.G = MatrixXd::Identity(14, 1);
  m.C = MatrixXd::Zero(1, 14);
  m.C(0, 0) = 1.0, m.C(0, 1) = -0.4, m.C(0, 12) = -1.0, m.C(0, 13) = 0.4;
  m.R.setZero(), m.S.setZero();
  const MatrixXd y = simulate_outputs(random, m, MatrixXd(0, 150), 150);
  std::vector<StateSpace> derivatives(4, zero_like(m));
  derivatives[0].A(0, 0) = derivatives[1].C(0, 1) = derivatives[2].C(0, 12) = 1.0;
  derivatives[3].Q(0, 0) = 1.0;
  expect_agreement(m, InitialState::stationary, y, derivatives, EvaluationMethod::steady_state);
}

TEST(Likelihood, OutputsAtDifferentRatesAgreeWithTheRecursion) {
  Random random(12);
  StateSpace m = random_model(random, 4, 0, 4, 4);
  m.A << 1, 0.02, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0.02, 0, 0, 0, 1;
  m.C << 1, 0, 0, 0, 0, 0, 1, 0, 0, 1, 0, 0, 0, 0, 0, 1;
  m.S.setZero();
  MatrixXd y = simulate_outputs(random, m, MatrixXd(0, 1000), 1000);
  for (Index t = 0; t < y.cols(); ++t) {
    if (t % 5 != 0) knock_out(y, t, 1, 0), knock_out(y, t, 1, 1);
    if (random.uniform() < 0.1) knock_out(y, t, 1, -1);
  }
  std::vector<StateSpace> derivatives = variances_of(m);
  derivatives.push_back(noise_direction(random, m));
  expect_agreement(m, InitialState::diffuse, y, derivatives, EvaluationMethod::steady_state);
  expect_agreement(m, InitialState::given, y, derivatives, EvaluationMethod::steady_state);
}

TEST(Likelihood, DriftingOutputsKeepTheirDigitsFromSums) {
  Random random(13);
  const auto chain = [&](Index n, const VectorXd& q) {
    StateSpace m = structural_model(2, 0.0, 0.0, 0.0, 1.0);
    m.A = MatrixXd::Identity(n, n);
    for (Index i = 0; i + 1 < n; ++i) m.A(i, i + 1) = 1.0;
    m.C = MatrixXd::Identity(1, n);
    m.G = m.Q = MatrixXd::Identity(n, n);
    m.Q.diagonal() = q;
    m.S = MatrixXd::Zero(n, 1);
    m.B.resize(n, 0);
    m.x0 = VectorXd::Zero(n);
    m.P0 = MatrixXd::Zero(n, n);
    return m;
  };
  const StateSpace models[] = {chain(1, VectorXd{{0.1}}), chain(2, VectorXd{{0.1, 0.02}}),
                               chain(3, VectorXd{{0.1, 0.02, 0.01}}),
                               structural_model(4, 0.2, 0.05, 0.1, 0.5)};
  for (const StateSpace& m : models) {
    SCOPED_TRACE(m.states());
    MatrixXd y = simulate_outputs(random, m, MatrixXd(0, 10000), 10000);
    y.array() += 1e4;
    expect_agreement(m, InitialState::diffuse, y, variances_of(m),
                     EvaluationMethod::autocovariances);
    // A second segment begins from a state.
    knock_out(y, 6000, 3, 0);
    expect_agreement(m, InitialState::diffuse, y, variances_of(m),
                     EvaluationMethod::autocovariances);
    // A maximum elsewhere: the nominal gain stays what the first evaluation made it.
    LikelihoodEngine engine;
    const MatrixXd u(0, y.cols());
    engine.add_recording(y, u);
    engine.evaluate(m, InitialState::diffuse, variances_of(m));
    StateSpace other = m;
    other.Q *= 3.0;
    EXPECT_NEAR(engine.evaluate(other, InitialState::diffuse).value,
                log_likelihood(other, InitialState::diffuse, y, u).value,
                1e-9 * std::abs(log_likelihood(other, InitialState::diffuse, y, u).value));
  }
}

TEST(Likelihood, RefusesShapesThatDisagree) {
  const LikelihoodCase c = random_case(3, 100, false);
  LikelihoodEngine engine;
  EXPECT_THROW(engine.evaluate(c.model, InitialState::stationary), std::invalid_argument);
  engine.add_recording(c.y, c.u);
  const MatrixXd more = MatrixXd::Zero(c.y.rows() + 1, 10), inputs = c.u.leftCols(10);
  EXPECT_THROW(engine.add_recording(more, inputs), std::invalid_argument);
  StateSpace no_start = c.model, larger = c.model;
  no_start.x0.resize(0);
  larger.A = MatrixXd::Zero(1 + larger.A.rows(), 1 + larger.A.rows());
  for (const EvaluationMethod method :
       {EvaluationMethod::time_varying, EvaluationMethod::automatic}) {
    EXPECT_THROW(engine.evaluate(no_start, InitialState::given, {}, method), std::invalid_argument);
    EXPECT_THROW(engine.evaluate(c.model, InitialState::given, {no_start}, method),
                 std::invalid_argument);
    EXPECT_THROW(engine.evaluate(c.model, InitialState::stationary, {larger}, method),
                 std::invalid_argument);
    EXPECT_THROW(engine.evaluate(StateSpace(), InitialState::stationary, {}, method),
                 std::invalid_argument);
  }
}

}  // namespace
}  // namespace identikal
