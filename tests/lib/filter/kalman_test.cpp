// The Kalman filter against the joint Gaussian density of a short record, written out in full.
#include "lib/filter/kalman.h"

#include <cmath>
#include <numbers>
#include <stdexcept>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <gtest/gtest.h>

#include "lib/base/constants.h"
#include "lib/base/random.h"
#include "lib/filter/gated_innovations.h"
#include "lib/filter/internal/recursion.h"
#include "lib/filter/steady_state.h"
#include "tests/support/joint_density.h"
#include "tests/support/random_model.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

struct FilterCase {
  StateSpace model;
  MatrixXd y, u;
};
FilterCase random_case(std::uint64_t seed, bool gaps) {
  Random random(seed);
  const auto pick = [&](int from, int to) {
    return static_cast<Index>(from + static_cast<int>(random.uniform() * (to - from + 1)));
  };
  const Index n = pick(1, 4), nu = pick(0, 2), ny = pick(1, 3), nw = pick(1, 3), N = 60 / ny;
  FilterCase out{random_model(random, n, nu, ny, nw), random_matrix(random, ny, N),
                 random_matrix(random, nu, N)};
  out.y *= 3.0;
  if (gaps) {
    for (Index i = 0; i < out.y.size(); ++i) {
      if (random.uniform() < 0.25) out.y(i % ny, i / ny) = std::nan("");
    }
    out.y.col(N / 2).setConstant(std::nan(""));
  }
  return out;
}

void expect_relative(double actual, double expected, double tolerance) {
  EXPECT_NEAR(actual, expected, tolerance * std::abs(expected));
}

TEST(Kalman, LikelihoodEqualsTheJointDensityOfAShortRecord) {
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    const FilterCase c = random_case(seed, seed % 2 == 0);
    const StateSpace& m = c.model;
    const Index N = c.y.cols();
    const Likelihood given = log_likelihood(m, InitialState::given, c.y, c.u);
    ASSERT_EQ(given.status, FilterStatus::ok);
    expect_relative(given.value, joint_log_density(stack(m, c.u, N, m.x0, m.P0), c.y), 1e-9);

    const VectorXd zero = VectorXd::Zero(m.states());
    const MatrixXd P = *solve_discrete_lyapunov(m.A, m.G * m.Q * m.G.transpose());
    const Likelihood stationary = log_likelihood(m, InitialState::stationary, c.y, c.u);
    expect_relative(stationary.value, joint_log_density(stack(m, c.u, N, zero, P), c.y), 1e-9);

    const Likelihood diffuse = log_likelihood(m, InitialState::diffuse, c.y, c.u);
    ASSERT_EQ(diffuse.status, FilterStatus::ok) << seed;
    expect_relative(
        diffuse.value,
        diffuse_log_density(stack(m, c.u, N, zero, MatrixXd::Zero(m.states(), m.states())), c.y),
        1e-9);
  }
}

// A(t), B(t), ..., R(t) each on a way of its own between the given model and a second one.
StateSpace moving(const StateSpace& from, const StateSpace& to, Index t) {
  const double share = 0.5 + 0.5 * std::sin(0.7 * static_cast<double>(t));
  StateSpace m = from;
  const auto mix = [share](auto& M, const auto& other) {
    M = ((1.0 - share) * M + share * other).eval();
  };
  mix(m.A, to.A), mix(m.B, to.B), mix(m.C, to.C), mix(m.D, to.D), mix(m.G, to.G);
  mix(m.Q, to.Q), mix(m.R, to.R), mix(m.S, to.S);
  return m;
}

TEST(Kalman, ModelsThatChangeWithTime) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const FilterCase c = random_case(seed, seed % 2 == 0);
    const StateSpace& m = c.model;
    const Index N = c.y.cols();
    Random random(1000 + seed);
    const StateSpace other = random_model(random, m.states(), m.inputs(), m.outputs(), m.G.cols());
    const StateSpace direction = random_direction(random, m);
    // The direction moves the first of the two models.
    const auto at = [&](double by) {
      return [&, by](Index t, StateSpace& model, std::vector<StateSpace>* derivatives) {
        StateSpace from = m;
        from.A += by * direction.A, from.B += by * direction.B, from.C += by * direction.C;
        from.D += by * direction.D, from.G += by * direction.G, from.Q += by * direction.Q;
        from.R += by * direction.R, from.S += by * direction.S;
        from.x0 += by * direction.x0, from.P0 += by * direction.P0;
        model = moving(from, other, t);
        if (derivatives == nullptr) return;
        StateSpace still = other;
        for (MatrixXd* M :
             {&still.A, &still.B, &still.C, &still.D, &still.G, &still.Q, &still.R, &still.S}) {
          M->setZero();
        }
        *derivatives = {moving(direction, still, t)};
      };
    };
    const auto joint = [&](const VectorXd& x0, const MatrixXd& P0) {
      return stack([&](Index t) { return moving(m, other, t); }, c.u, N, x0, P0);
    };
    const Likelihood given = log_likelihood(at(0.0), InitialState::given, c.y, c.u, true);
    expect_relative(given.value, joint_log_density(joint(m.x0, m.P0), c.y), 1e-9);
    const VectorXd zero = VectorXd::Zero(m.states());
    const Likelihood diffuse = log_likelihood(at(0.0), InitialState::diffuse, c.y, c.u, true);
    expect_relative(diffuse.value,
                    diffuse_log_density(joint(zero, MatrixXd::Zero(m.states(), m.states())), c.y),
                    1e-9);
    for (const InitialState initial : {InitialState::given, InitialState::diffuse}) {
      const double h = 1e-5;
      const double up = log_likelihood(at(h), initial, c.y, c.u, false).value;
      const double down = log_likelihood(at(-h), initial, c.y, c.u, false).value;
      const double slope = (initial == InitialState::given ? given : diffuse).gradient[0];
      EXPECT_NEAR((up - down) / (2.0 * h), slope, 1e-5 * (1.0 + std::abs(slope))) << seed;
    }
    const FilterResult filter = kalman_filter(at(0.0), InitialState::given, c.y, c.u);
    expect_relative(filter.log_likelihood, given.value, 1e-12);
  }
}

Likelihood one_by_one(const ModelAt& at, InitialState initial, const MatrixXd& y,
                      const MatrixXd& u) {
  StateSpace now;
  std::vector<StateSpace> by;
  at(0, now, &by);
  const Eigen::Ref<const MatrixXd> outputs = y, inputs = u;
  Recursion recursion(now, initial, outputs, inputs, by);
  recursion.set_model_change([&](Index t) { at(t, now, &by); }, by);
  RecursionOptions options;
  return recursion.run(options);
}

// Against the recursion that keeps a covariance for every derivative: what changes is C, D and R, or all.
TEST(Kalman, DerivativesSideBySideAreThoseOneByOne) {
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    FilterCase c = random_case(seed, false);
    Random random(2000 + seed);
    const StateSpace& m = c.model;
    const StateSpace other = random_model(random, m.states(), m.inputs(), m.outputs(), m.G.cols());
    std::vector<StateSpace> by;
    for (int i = 0; i < 9; ++i) by.push_back(random_direction(random, m));
    const bool motion_changes = seed % 2 == 0, outputs_move = seed % 3 == 0;
    for (StateSpace& d : by) {
      if (!outputs_move) d.C.setZero();
    }
    if (seed % 5 == 0) c.y(0, 4) = c.y(c.y.rows() - 1, 7) = std::nan("");
    const ModelAt at = [&](Index t, StateSpace& model, std::vector<StateSpace>* derivatives) {
      model = moving(m, other, t);
      if (!motion_changes) {
        model.A = m.A, model.B = m.B, model.G = m.G, model.Q = m.Q, model.S = m.S;
      }
      if (derivatives == nullptr) return;
      *derivatives = by;
      for (StateSpace& d : *derivatives) {
        d.C *= t % 4;
        if (motion_changes) d.A *= std::cos(0.3 * static_cast<double>(t));
      }
    };
    for (const InitialState initial : {InitialState::given, InitialState::diffuse}) {
      const Likelihood fast = log_likelihood(at, initial, c.y, c.u, true, motion_changes);
      const Likelihood slow = one_by_one(at, initial, c.y, c.u);
      ASSERT_EQ(fast.status, slow.status);
      if (fast.status != FilterStatus::ok) continue;
      expect_relative(fast.value, slow.value, 1e-11);
      EXPECT_LT((fast.gradient - slow.gradient).norm(), 1e-8 * (1.0 + slow.gradient.norm()))
          << seed;
      EXPECT_LT((fast.information - slow.information).norm(), 1e-8 * slow.information.norm());
    }
  }
}

TEST(Kalman, SizesMustNotChangeWithTime) {
  const ModelAt grows = [](Index t, StateSpace& model, std::vector<StateSpace>*) {
    Random random(1);
    model = random_model(random, 1 + t / 3, 0, 1, 1);
  };
  EXPECT_THROW(kalman_filter(grows, InitialState::diffuse, MatrixXd::Ones(1, 9), MatrixXd(0, 9)),
               std::invalid_argument);
  EXPECT_THROW(
      log_likelihood(grows, InitialState::diffuse, MatrixXd::Ones(1, 9), MatrixXd(0, 9), false),
      std::invalid_argument);
}

TEST(Kalman, DiffuseStartHoldsForIntegratorsAndWithoutMeasurementNoise) {
  StateSpace m;
  m.A.resize(2, 2);
  m.A << 1, 1, 0, 1;
  m.B.resize(2, 0);
  m.C = Eigen::RowVector2d(1, 0);
  m.D.resize(1, 0);
  m.G = MatrixXd::Identity(2, 2);
  m.Q = Eigen::Vector2d(0.3, 0.05).asDiagonal();
  m.R = MatrixXd::Constant(1, 1, 0.0);
  m.S = MatrixXd::Zero(2, 1);
  Random random(4);
  const MatrixXd y = 5.0 * random_matrix(random, 1, 30), u(0, 30);
  const Likelihood diffuse = log_likelihood(m, InitialState::diffuse, y, u);
  ASSERT_EQ(diffuse.status, FilterStatus::ok);
  // The stacked covariance is singular at t = 1 (no noise reaches y(1) but through x(1)); a finite
  // part of x(1) changes nothing and makes it regular.
  const Stacked s = stack(m, u, 30, Eigen::Vector2d::Zero(), MatrixXd::Identity(2, 2));
  expect_relative(diffuse.value, diffuse_log_density(s, y), 1e-9);
}

TEST(Kalman, GradientIsExact) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const FilterCase c = random_case(seed, seed % 2 == 0);
    Random random(seed + 100);
    // A random direction that moves every matrix at once.
    const Index n = c.model.states(), nw = c.model.G.cols(), ny = c.model.outputs(),
                nu = c.model.inputs();
    StateSpace d;
    d.A = 0.1 * random_matrix(random, n, n);
    d.B = random_matrix(random, n, nu);
    d.C = random_matrix(random, ny, n);
    d.D = random_matrix(random, ny, nu);
    d.G = random_matrix(random, n, nw);
    const MatrixXd q = random_matrix(random, nw, nw), r = random_matrix(random, ny, ny),
                   p = random_matrix(random, n, n);
    d.Q = q + q.transpose();
    d.R = r + r.transpose();
    d.S = random_matrix(random, nw, ny);
    d.x0 = random.normal(n);
    d.P0 = p + p.transpose();
    const auto moved = [&](double h) {
      StateSpace m = c.model;
      m.A += h * d.A, m.B += h * d.B, m.C += h * d.C, m.D += h * d.D, m.G += h * d.G;
      m.Q += h * d.Q, m.R += h * d.R, m.S += h * d.S, m.x0 += h * d.x0, m.P0 += h * d.P0;
      return m;
    };
    for (const InitialState initial :
         {InitialState::given, InitialState::stationary, InitialState::diffuse}) {
      const Likelihood exact = log_likelihood(c.model, initial, c.y, c.u, {d});
      ASSERT_EQ(exact.status, FilterStatus::ok);
      const auto L = [&](double h) { return log_likelihood(moved(h), initial, c.y, c.u).value; };
      const double h = 1e-4;
      const double difference = (8.0 * (L(h) - L(-h)) - (L(2 * h) - L(-2 * h))) / (12.0 * h);
      EXPECT_NEAR(exact.gradient[0], difference, 1e-6 * std::max(1.0, std::abs(difference)))
          << "seed " << seed << " initial " << static_cast<int>(initial);
    }
  }
}

TEST(Kalman, ExpectedInformationIsTheCovarianceOfTheScore) {
  // 2000 simulated scores of (q, r): sample covariances have a relative standard error of about 3
  // %, so five of them.
  StateSpace m;
  m.A = MatrixXd::Constant(1, 1, 0.5);
  m.B.resize(1, 0);
  m.C = MatrixXd::Identity(1, 1);
  m.D.resize(1, 0);
  m.G = MatrixXd::Identity(1, 1);
  m.Q = MatrixXd::Constant(1, 1, 3.0);
  m.R = MatrixXd::Constant(1, 1, 2.0);
  m.S = MatrixXd::Zero(1, 1);
  std::vector<StateSpace> d(2, m);
  for (StateSpace& s : d) {
    s.A.setZero(), s.C.setZero(), s.G.setZero(), s.Q.setZero(), s.R.setZero();
  }
  d[0].Q(0, 0) = 1.0;
  d[1].R(0, 0) = 1.0;
  Random random(7);
  const int runs = 2000, N = 100;
  MatrixXd scores(2, runs), information = MatrixXd::Zero(2, 2), y(1, N);
  for (int run = 0; run < runs; ++run) {
    double x = 2.0 * random.normal();  // stationary: 3 / (1 - 0.25) = 4
    for (int t = 0; t < N; ++t) {
      y(0, t) = x + std::sqrt(2.0) * random.normal();
      x = 0.5 * x + std::sqrt(3.0) * random.normal();
    }
    const Likelihood l = log_likelihood(m, InitialState::stationary, y, MatrixXd(0, N), d);
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
}

// Samples of a diffuse start count as one; two of them determine four states. Of a model that changes, too.
TEST(Kalman, ScoreProductsAreThoseOfEachSamplesOwnDensity) {
  Random random(8);
  const StateSpace m = random_model(random, 4, 1, 2, 2);
  const Index N = 120;
  const MatrixXd u = random_matrix(random, 1, N);
  MatrixXd y = simulate_outputs(random, m, u, N);
  y(1, 3) = std::nan("");
  const std::vector<StateSpace> d{random_direction(random, m), random_direction(random, m)};
  const ModelAt at = [&](Index, StateSpace& model, std::vector<StateSpace>* derivatives) {
    model = m;
    if (derivatives != nullptr) *derivatives = d;
  };
  for (const InitialState start : {InitialState::given, InitialState::diffuse}) {
    MatrixXd expected = MatrixXd::Zero(2, 2);
    VectorXd before = VectorXd::Zero(2);
    Index undetermined = 0;
    for (Index t = 1; t <= N; ++t) {
      const Likelihood until = log_likelihood(m, start, y.leftCols(t), u.leftCols(t), d);
      undetermined += until.status != FilterStatus::ok;
      if (until.status != FilterStatus::ok) continue;
      expected += (until.gradient - before) * (until.gradient - before).transpose();
      before = until.gradient;
    }
    EXPECT_EQ(undetermined, start == InitialState::diffuse ? 1 : 0);
    EXPECT_TRUE(score_products(m, start, y, u, d).isApprox(expected, 1e-7));
    EXPECT_TRUE(score_products(at, start, y, u).isApprox(expected, 1e-7));
  }
}

TEST(Kalman, StaysDefiniteOnStiffNoise) {
  // System 7 of the second source, where the unsymmetrised plain recursion overflows, and nearly no
  // R.
  StateSpace m;
  m.A.resize(4, 4);
  m.A << 0.9, 0, 1, 1, 0, -0.8, 0, -1, 0, -0.1, 0.85, 1, -0.2, 0, 0, -0.9;
  m.B.resize(4, 0);
  m.C.resize(2, 4);
  m.C << 1, 0, 0, 1, 0, 1, 1, 0;
  m.D.resize(2, 0);
  m.G.resize(4, 3);
  m.G << 0, 0, 0.1, 1, 0, 0, 0, 1, 0, 0, 0, 1;
  m.Q = Eigen::Vector3d(10, 3, 7).asDiagonal();
  m.S = MatrixXd::Zero(3, 2);
  for (const double r : {1.0, 1e-12}) {
    m.R = r * Eigen::Vector2d(1.5, 3.0).asDiagonal().toDenseMatrix();
    Random random(3);
    MatrixXd y(2, 50000);
    for (Index t = 0; t < y.cols(); ++t) y.col(t) = 5.0 * random.normal(2);
    const Likelihood l = log_likelihood(m, InitialState::stationary, y, MatrixXd(0, y.cols()));
    EXPECT_EQ(l.status, FilterStatus::ok) << "r = " << r;
    EXPECT_TRUE(std::isfinite(l.value));
  }
}

TEST(Kalman, ConstantGainEqualsTheFullRecursion) {
  // Keep::everything never switches to the constant gain. Gaps make the other one leave it and come
  // back.
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    Random random(seed);
    FilterCase c = random_case(seed, false);
    const Index ny = c.y.rows(), N = 3000;
    c.y = random_matrix(random, ny, N);
    c.u = random_matrix(random, c.u.rows(), N);
    c.y(0, 1000) = std::nan("");
    StateSpace d = c.model;
    d.A = 0.1 * random_matrix(random, d.A.rows(), d.A.cols());
    d.B = random_matrix(random, d.B.rows(), d.B.cols());
    d.G.setZero(), d.Q.setZero(), d.S.setZero(), d.x0.setZero(), d.P0.setZero();
    d.R = MatrixXd::Identity(ny, ny);
    const auto full = [&](double h) {
      StateSpace m = c.model;
      m.A += h * d.A, m.B += h * d.B, m.C += h * d.C, m.D += h * d.D, m.R += h * d.R;
      return kalman_filter(m, InitialState::diffuse, c.y, c.u);
    };
    const Likelihood l = log_likelihood(c.model, InitialState::diffuse, c.y, c.u, {d});
    const FilterResult all = full(0.0);
    ASSERT_EQ(l.status, FilterStatus::ok);
    expect_relative(l.value, all.log_likelihood, 1e-12);
    const double h = 1e-5,
                 difference = (full(h).log_likelihood - full(-h).log_likelihood) / (2.0 * h);
    EXPECT_NEAR(l.gradient[0], difference, 1e-6 * std::max(1.0, std::abs(difference)));
    const FilterResult few =
        kalman_filter(c.model, InitialState::diffuse, c.y, c.u, Keep::innovations);
    const MatrixXd difference_e = (few.standardised - all.standardised).cwiseAbs();
    EXPECT_LT(difference_e.unaryExpr([](double v) { return std::isnan(v) ? 0.0 : v; }).maxCoeff(),
              1e-9);
    EXPECT_EQ(few.e.array().isNaN().count(), all.e.array().isNaN().count());
  }
}

TEST(Kalman, SaysWhatIsWrong) {
  Random random(1);
  FilterCase c = random_case(3, false);
  c.model.A *= 1.2;
  EXPECT_EQ(log_likelihood(c.model, InitialState::stationary, c.y, c.u).status,
            FilterStatus::unstable);
  c.model.R.setZero();
  c.model.S.setZero();
  c.model.Q.setZero();
  c.model.P0.setZero();
  EXPECT_EQ(log_likelihood(c.model, InitialState::given, c.y, c.u).status,
            FilterStatus::indefinite);
  EXPECT_THROW(log_likelihood(c.model, InitialState::given, c.y.topRows(0), c.u),
               std::invalid_argument);
}

TEST(Kalman, FilteredStatesMatchRegression) {
  // E x(t) and its covariance given y up to t, from the joint Gaussian distribution.
  const FilterCase c = random_case(12, true);
  const StateSpace& m = c.model;
  const FilterResult f = kalman_filter(m, InitialState::given, c.y, c.u);
  ASSERT_EQ(f.status, FilterStatus::ok);
  const Index N = 6, n = m.states();
  // Observe the state itself as an extra noise-free output at the last time: append it to the
  // stacked vector.
  StateSpace wide = m;
  wide.C.conservativeResize(m.outputs() + n, n);
  wide.C.bottomRows(n).setIdentity();
  wide.D.conservativeResize(m.outputs() + n, m.inputs());
  wide.D.bottomRows(n).setZero();
  wide.R = MatrixXd::Zero(m.outputs() + n, m.outputs() + n);
  wide.R.topLeftCorner(m.outputs(), m.outputs()) = m.R;
  wide.S = MatrixXd::Zero(m.G.cols(), m.outputs() + n);
  wide.S.leftCols(m.outputs()) = m.S;
  const Stacked s = stack(wide, c.u, N, m.x0, m.P0);
  const Index stride = m.outputs() + n;
  std::vector<Index> seen, wanted;
  std::vector<double> values;
  for (Index t = 0; t < N; ++t) {
    for (Index i = 0; i < m.outputs(); ++i) {
      if (std::isnan(c.y(i, t))) continue;
      seen.push_back(t * stride + i);
      values.push_back(c.y(i, t));
    }
  }
  for (Index i = 0; i < n; ++i) wanted.push_back((N - 1) * stride + m.outputs() + i);
  const VectorXd e =
      Eigen::Map<const VectorXd>(values.data(), static_cast<Index>(values.size())) - s.mean(seen);
  const Eigen::LLT<MatrixXd> llt(s.covariance(seen, seen));
  const MatrixXd cross = s.covariance(wanted, seen);
  const VectorXd x = s.mean(wanted) + cross * llt.solve(e);
  const MatrixXd P = s.covariance(wanted, wanted) - cross * llt.solve(cross.transpose());
  EXPECT_TRUE(f.x_filt.col(N - 1).isApprox(x, 1e-9));
  EXPECT_TRUE(f.P_filt[static_cast<std::size_t>(N - 1)].isApprox(P, 1e-8));
}

TEST(GatedInnovations, AreThoseOfTheRecordingWithoutWhatWasRefused) {
  Random random(21);
  for (const InitialState initial : {InitialState::given, InitialState::diffuse}) {
    StateSpace m = random_model(random, 3, 1, 2, 3);
    const MatrixXd u = random_matrix(random, 1, 2000);
    MatrixXd y = simulate_outputs(random, m, u, 2000);
    y(0, 700) = kNaN;
    // Far apart, in a row, at the start and the end, both outputs of one sample.
    for (const Index t : {Index{20}, Index{300}, Index{301}, Index{302}, Index{900}, Index{1999}}) {
      y(0, t) += 1e3;
    }
    y(1, 900) -= 1e3;
    std::vector<std::pair<int, Index>> refused;
    const auto far = [&](Index t, const FilterResult& so_far) {
      const VectorXd e = so_far.e.col(t).cwiseAbs().cwiseQuotient(so_far.e_sd.col(t));
      for (const int i : {0, 1}) {
        if (!(e[i] > 10.0)) continue;
        refused.emplace_back(i, t);
        return i;
      }
      return -1;
    };
    MatrixXd kept = y;
    const FilterResult gated = gated_innovations(m, initial, kept, u, 50, far);
    ASSERT_EQ(gated.status, FilterStatus::ok);
    const std::vector<std::pair<int, Index>> wanted = {{0, 20},  {0, 300}, {0, 301}, {0, 302},
                                                       {0, 900}, {1, 900}, {0, 1999}};
    EXPECT_EQ(refused, wanted);
    const FilterResult whole = kalman_filter(m, initial, kept, u);
    EXPECT_EQ(gated.first_proper, whole.first_proper);
    for (Index t = 0; t < y.cols(); ++t) {
      for (Index i = 0; i < 2; ++i) {
        ASSERT_EQ(std::isnan(gated.e(i, t)), std::isnan(whole.e(i, t))) << t;
        if (std::isnan(whole.e(i, t))) continue;
        ASSERT_NEAR(gated.e(i, t), whole.e(i, t), 1e-9 * whole.e_sd(i, t)) << t;
        ASSERT_NEAR(gated.standardised(i, t), whole.standardised(i, t), 1e-9) << t;
      }
    }
  }
}

}  // namespace
}  // namespace identikal
