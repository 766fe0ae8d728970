// The smoothers against the conditional mean and covariance of the states in the joint Gaussian
// distribution of a short record, written out in full.
#include "lib/filter/smoother.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <stdexcept>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <gtest/gtest.h>

#include "lib/base/random.h"
#include "lib/data/csv.h"
#include "lib/filter/steady_state.h"
#include "tests/support/joint_density.h"
#include "tests/support/random_model.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// The witness has more digits than what it judges.
using Exact = Eigen::Matrix<long double, Eigen::Dynamic, Eigen::Dynamic>;

// All states and outputs are known + from_delta delta + from_noise [x1 - mean; w1; v1; w2; ...].
struct JointStates {
  Exact x_mean, y_mean;
  Exact xx, xy, yy;  // covariances
  Exact x_delta, y_delta;
};
JointStates joint_states(const std::function<StateSpace(Index)>& model_at, const MatrixXd& u,
                         Index N, const VectorXd& x0, const MatrixXd& P0) {
  const StateSpace first = model_at(0);
  const Index n = first.states(), ny = first.outputs(), nw = first.G.cols(), block = nw + ny;
  const Index all = n + N * block;
  Exact noise = Exact::Zero(all, all);
  noise.topLeftCorner(n, n) = P0.cast<long double>();
  Exact x = Exact::Zero(n, all), X = Exact::Zero(N * n, all), Y(N * ny, all);
  x.leftCols(n).setIdentity();
  JointStates out{Exact(N * n, 1), Exact(N * ny, 1), {}, {}, {}, Exact(N * n, n), Exact(N * ny, n)};
  Exact mean = x0.cast<long double>(), power = Exact::Identity(n, n);
  for (Index t = 0; t < N; ++t) {
    const StateSpace m = model_at(t);
    const Exact A = m.A.cast<long double>(), C = m.C.cast<long double>();
    const Index at = n + t * block;
    noise.block(at, at, block, block) = joint_covariance(m).cast<long double>();
    out.x_mean.middleRows(t * n, n) = mean;
    out.y_mean.middleRows(t * ny, ny) = C * mean;
    out.x_delta.middleRows(t * n, n) = power;
    out.y_delta.middleRows(t * ny, ny) = C * power;
    X.middleRows(t * n, n) = x;
    Y.middleRows(t * ny, ny) = C * x;
    Y.block(t * ny, at + nw, ny, ny) += Exact::Identity(ny, ny);
    mean = (A * mean).eval();
    if (m.inputs() > 0) {
      const Exact input = u.col(t).cast<long double>();
      out.y_mean.middleRows(t * ny, ny) += m.D.cast<long double>() * input;
      mean += m.B.cast<long double>() * input;
    }
    x = (A * x).eval();
    x.block(0, at, n, nw) += m.G.cast<long double>();
    power = (A * power).eval();
  }
  out.xx = X * noise * X.transpose();
  out.xy = X * noise * Y.transpose();
  out.yy = Y * noise * Y.transpose();
  return out;
}

struct Conditional {
  VectorXd x;
  MatrixXd P;
};
// Of all states given y; with a diffuse x1, delta is estimated by generalised least squares.
Conditional given_outputs(const JointStates& joint, const MatrixXd& y, bool diffuse) {
  const Present p = present(y);
  const Exact e = p.y.cast<long double>() - joint.y_mean(p.rows, Eigen::all);
  const Eigen::LLT<Exact> V(joint.yy(p.rows, p.rows));
  const Exact xy = joint.xy(Eigen::all, p.rows);
  Exact x = joint.x_mean + xy * V.solve(e), P = joint.xx - xy * V.solve(xy.transpose());
  if (diffuse) {
    const Exact Y = joint.y_delta(p.rows, Eigen::all), ViY = V.solve(Y);
    const Eigen::LLT<Exact> information(Y.transpose() * ViY);
    const Exact X = joint.x_delta - xy * ViY;
    x += X * information.solve(ViY.transpose() * e);
    P += X * information.solve(X.transpose());
  }
  return {x.cast<double>(), P.cast<double>()};
}

struct SmootherCase {
  StateSpace model, other;
  MatrixXd y, u;
};
SmootherCase smoother_case(std::uint64_t seed, Index samples) {
  Random random(seed);
  const auto pick = [&](int from, int to) {
    return static_cast<Index>(from + static_cast<int>(random.uniform() * (to - from + 1)));
  };
  const Index n = pick(1, 4), nu = pick(0, 2), ny = pick(1, 3), nw = pick(1, 3);
  SmootherCase out;
  out.model = random_model(random, n, nu, ny, nw);
  out.other = random_model(random, n, nu, ny, nw);
  if (seed % 3 == 0) out.model.A.col(0).setZero();  // singular
  out.u = random_matrix(random, nu, samples);
  out.y = simulate_outputs(random, out.model, out.u, samples);
  if (seed % 2 == 0) {
    for (Index i = 0; i < out.y.size(); ++i) {
      if (random.uniform() < 0.25) out.y(i % ny, i / ny) = std::nan("");
    }
    out.y.col(samples / 2).setConstant(std::nan(""));
  }
  return out;
}

// Largest error, in standard deviations, and of the covariance in their products.
double error_of(const VectorXd& x, const MatrixXd& P, const VectorXd& x_true,
                const MatrixXd& P_true) {
  const VectorXd sd = P_true.diagonal().cwiseSqrt();
  return std::max((x - x_true).cwiseQuotient(sd).cwiseAbs().maxCoeff(),
                  (P - P_true).cwiseQuotient(sd * sd.transpose()).cwiseAbs().maxCoeff());
}

double largest_error(const SmootherResult& smoothed, const Conditional& truth, Index n) {
  double out = 0.0;
  for (Index t = 0; t < smoothed.x.cols(); ++t) {
    const MatrixXd P_true = truth.P.block(t * n, t * n, n, n);
    const MatrixXd& P = smoothed.P[static_cast<std::size_t>(t)];
    out = std::max(out, error_of(smoothed.x.col(t), P, truth.x.segment(t * n, n), P_true));
    EXPECT_EQ((smoothed.sd.col(t) - P.diagonal().cwiseSqrt()).norm(), 0.0);
  }
  return out;
}

TEST(Smoother, IntervalEqualsTheConditionalDistributionOfTheJointDensity) {
  double worst = 0.0;
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    const SmootherCase c = smoother_case(seed, 30);
    const StateSpace& m = c.model;
    const Index n = m.states(), N = c.y.cols();
    const auto at = [&m](Index) { return m; };
    const VectorXd zero = VectorXd::Zero(n);
    const MatrixXd stationary = *solve_discrete_lyapunov(m.A, m.G * m.Q * m.G.transpose());

    const SmootherResult given = smooth(m, InitialState::given, c.y, c.u);
    ASSERT_EQ(given.status, FilterStatus::ok);
    EXPECT_NEAR(given.log_likelihood, log_likelihood(m, InitialState::given, c.y, c.u).value,
                1e-10 * std::abs(given.log_likelihood));
    worst = std::max(
        worst,
        largest_error(given, given_outputs(joint_states(at, c.u, N, m.x0, m.P0), c.y, false), n));
    worst = std::max(
        worst,
        largest_error(smooth(m, InitialState::stationary, c.y, c.u),
                      given_outputs(joint_states(at, c.u, N, zero, stationary), c.y, false), n));
  }
  std::printf("largest error of the fixed-interval smoother: %.2g sd\n", worst);
  EXPECT_LT(worst, 1e-9);
}

TEST(Smoother, DiffuseStart) {
  double worst = 0.0;
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    SmootherCase c = smoother_case(seed, 30);
    // Nothing of a state that A forgets at once can be told but by the first sample.
    if (seed % 3 == 0) c.model.A = c.other.A;
    const StateSpace& m = c.model;
    const Index n = m.states(), N = c.y.cols();
    const SmootherResult diffuse = smooth(m, InitialState::diffuse, c.y, c.u);
    ASSERT_EQ(diffuse.status, FilterStatus::ok) << seed;
    EXPECT_NEAR(diffuse.log_likelihood, log_likelihood(m, InitialState::diffuse, c.y, c.u).value,
                1e-9 * std::abs(diffuse.log_likelihood));
    const JointStates joint =
        joint_states([&m](Index) { return m; }, c.u, N, VectorXd::Zero(n), MatrixXd::Zero(n, n));
    worst = std::max(worst, largest_error(diffuse, given_outputs(joint, c.y, true), n));
  }
  std::printf("largest error with a diffuse start: %.2g sd\n", worst);
  EXPECT_LT(worst, 1e-9);
}

// A(t), B(t), ..., R(t) on their way between two models.
StateSpace between(const StateSpace& from, const StateSpace& to, Index t) {
  const double share = 0.5 + 0.5 * std::sin(0.7 * static_cast<double>(t));
  StateSpace m = from;
  const auto mix = [share](auto& M, const auto& other) {
    M = ((1.0 - share) * M + share * other).eval();
  };
  mix(m.A, to.A), mix(m.B, to.B), mix(m.C, to.C), mix(m.D, to.D), mix(m.G, to.G);
  mix(m.Q, to.Q), mix(m.R, to.R), mix(m.S, to.S);
  return m;
}

// Positions that are thousands of times larger than their noise: the first state's covariance is
// that of a regression of the joint density on it, and no function of the outputs' size.
TEST(Smoother, DiffuseStartOfLargeOutputs) {
  StateSpace m;
  m.A = (MatrixXd(2, 2) << 1, 0.1, 0, 1).finished();
  m.B.setZero(2, 0);
  m.C = (MatrixXd(1, 2) << 1, 0).finished();
  m.D.setZero(1, 0);
  m.G = MatrixXd::Identity(2, 2);
  m.Q = 2.0 * (MatrixXd(2, 2) << 1e-3 / 3.0, 5e-3, 5e-3, 0.1).finished();
  m.R.setConstant(1, 1, 0.1);
  m.S.setZero(2, 1);
  constexpr Index kSamples = 300;
  const MatrixXd y = VectorXd::LinSpaced(kSamples, -4000.0, 4000.0).transpose();
  const MatrixXd u(0, kSamples);
  const Stacked all = stack(m, u, kSamples, VectorXd::Zero(2), MatrixXd::Zero(2, 2));
  const Eigen::LLT<MatrixXd> V(all.covariance);
  const MatrixXd P = (all.from_x1.transpose() * V.solve(all.from_x1)).inverse();
  const VectorXd x = P * (all.from_x1.transpose() * V.solve(y.transpose()));
  const SmootherResult smoothed = smooth(m, InitialState::diffuse, y, u);
  const double off =
      (smoothed.sd.col(0).array() / P.diagonal().array().sqrt() - 1.0).abs().maxCoeff();
  std::printf("standard errors of the first state %.1e off\n", off);
  EXPECT_LT(off, 1e-9);
  EXPECT_LT((smoothed.x.col(0) - x).cwiseAbs().maxCoeff(), 1e-8);
}

TEST(Smoother, ModelsThatChangeWithTime) {
  double worst = 0.0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const SmootherCase c = smoother_case(seed, 20);
    const Index n = c.model.states(), N = c.y.cols();
    const auto at = [&](Index t) { return between(c.model, c.other, t); };
    const ModelAt model = [&](Index t, StateSpace& m, std::vector<StateSpace>*) { m = at(t); };
    const JointStates given = joint_states(at, c.u, N, c.model.x0, c.model.P0);
    worst = std::max(worst, largest_error(smooth(model, InitialState::given, c.y, c.u),
                                          given_outputs(given, c.y, false), n));
    const JointStates diffuse = joint_states(at, c.u, N, VectorXd::Zero(n), MatrixXd::Zero(n, n));
    worst = std::max(worst, largest_error(smooth(model, InitialState::diffuse, c.y, c.u),
                                          given_outputs(diffuse, c.y, true), n));
    const SmootherResult lagged = smooth_with_lag(model, InitialState::given, c.y, c.u, 3);
    const Conditional to_6 =
        given_outputs(joint_states(at, c.u, 7, c.model.x0, c.model.P0), c.y.leftCols(7), false);
    worst = std::max(worst, error_of(lagged.x.col(3), lagged.P[3], to_6.x.segment(3 * n, n),
                                     to_6.P.block(3 * n, 3 * n, n, n)));
  }
  EXPECT_LT(worst, 1e-9);
}

TEST(Smoother, LagEqualsTheRecordUpToThen) {
  double worst = 0.0;
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    SmootherCase c = smoother_case(seed, 16);
    if (seed % 3 == 0) c.model.A = c.other.A;
    const StateSpace& m = c.model;
    const Index n = m.states(), N = c.y.cols();
    const auto at = [&m](Index) { return m; };
    for (const bool diffuse : {false, true}) {
      std::vector<Conditional> given_until;  // [k]: the first k + 1 samples
      for (Index until = 1; until <= N; ++until) {
        const JointStates joint = joint_states(at, c.u, until, diffuse ? VectorXd::Zero(n) : m.x0,
                                               diffuse ? MatrixXd::Zero(n, n) : m.P0);
        given_until.push_back(given_outputs(joint, c.y.leftCols(until), diffuse));
      }
      for (const Index lag : {0, 1, 4, 15, 40}) {
        const SmootherResult lagged = smooth_with_lag(
            m, diffuse ? InitialState::diffuse : InitialState::given, c.y, c.u, lag);
        ASSERT_EQ(lagged.status, FilterStatus::ok);
        for (Index t = 0; t < N; ++t) {
          if (std::isnan(lagged.x(0, t))) {
            // Too few samples for the start.
            EXPECT_TRUE(diffuse && t + lag <= 2 * n) << seed << " " << t << " " << lag;
            continue;
          }
          const auto last = static_cast<std::size_t>(std::min(t + lag, N - 1));
          const Conditional& truth = given_until[last];
          const double error =
              error_of(lagged.x.col(t), lagged.P[static_cast<std::size_t>(t)],
                       truth.x.segment(t * n, n), truth.P.block(t * n, t * n, n, n));
          worst = std::max(worst, error);
        }
      }
    }
  }
  std::printf("largest error of the fixed-lag smoother: %.2g sd\n", worst);
  EXPECT_LT(worst, 1e-9);
}

// Longer than the time that gain and adjoint need to settle, over several blocks, with gaps: the
// fixed-lag smoother with a lag as long as the record keeps nothing but the gain, and a model that
// is said to change keeps nothing at all.
TEST(Smoother, ConstantGainChangesNothing) {
  for (const InitialState initial : {InitialState::given, InitialState::diffuse}) {
    Random random(7);
    StateSpace m = random_model(random, 3, 1, 2, 2);
    const MatrixXd u = random_matrix(random, 1, 900);
    MatrixXd y = simulate_outputs(random, m, u, 900);
    y(0, 300) = y(1, 700) = std::nan("");
    y.col(701).setConstant(std::nan(""));
    const ModelAt same = [&m](Index, StateSpace& now, std::vector<StateSpace>*) { now = m; };
    const auto largest_difference = [](const SmootherResult& a, const SmootherResult& b) {
      double out = 0.0;
      for (Index t = 0; t < a.x.cols(); ++t) {
        const auto i = static_cast<std::size_t>(t);
        if (std::isnan(a.x(0, t)) && std::isnan(b.x(0, t))) continue;
        out = std::max(out, error_of(a.x.col(t), a.P[i], b.x.col(t), b.P[i]));
      }
      return out;
    };
    const SmootherResult plain = smooth(same, initial, y, u);
    EXPECT_LT(largest_difference(smooth(m, initial, y, u), plain), 1e-11);
    EXPECT_LT(largest_difference(smooth_with_lag(m, initial, y, u, 2000), plain), 1e-11);
    for (const Index lag : {0, 25}) {
      EXPECT_LT(largest_difference(smooth_with_lag(m, initial, y, u, lag),
                                   smooth_with_lag(same, initial, y, u, lag)),
                1e-11);
    }
    const SmootherResult filtered = smooth_with_lag(m, initial, y, u, 0);
    const FilterResult filter = kalman_filter(m, initial, y, u);
    for (Index t = filter.first_proper; t < y.cols(); ++t) {
      EXPECT_LT((filtered.x.col(t) - filter.x_filt.col(t)).norm(), 1e-10);
      EXPECT_LT(
          (filtered.P[static_cast<std::size_t>(t)] - filter.P_filt[static_cast<std::size_t>(t)])
              .norm(),
          1e-10);
    }
    const SmootherResult slim = smooth(m, initial, y, u, SmootherKeep::deviations);
    EXPECT_TRUE(slim.P.empty());
    EXPECT_EQ((slim.sd - smooth(m, initial, y, u).sd).norm(), 0.0);
  }
}

// Durbin & Koopman (2012), section 2.4 and figure 2.2; digits of statsmodels 0.13.5,
// UnobservedComponents(y, 'llevel') with Initialization(1, 'diffuse') at [15099, 1469.1].
TEST(Smoother, LevelOfTheNile) {
  const Table table = read_csv(IDENTIKAL_SOURCE_DIR "/data/nile.csv");
  const std::vector<double>& flow = table.columns[1].values;
  const MatrixXd y = Eigen::Map<const Eigen::RowVectorXd>(flow.data(), 100);
  StateSpace m;
  m.A = m.C = m.G = MatrixXd::Ones(1, 1);
  m.B = m.D = MatrixXd(1, 0);
  m.Q = MatrixXd::Constant(1, 1, 1469.1);
  m.R = MatrixXd::Constant(1, 1, 15099.0);
  m.S = MatrixXd::Zero(1, 1);
  const MatrixXd u(0, 100);
  const SmootherResult smoothed = smooth(m, InitialState::diffuse, y, u);
  const SmootherResult filtered = smooth_with_lag(m, InitialState::diffuse, y, u, 0);
  EXPECT_NEAR(smoothed.log_likelihood, -632.5456251156739, 1e-9);
  const struct {
    Index t;
    double smoothed, variance, filtered, filtered_variance;
  } published[] = {
      {0, 1111.6683191267957, 4032.1579418084766, 1120.0, 15099.0},
      {1, 1110.857664621807, 3242.9300732247184, 1140.927839934822, 7899.7363793969125},
      {27, 999.585218705269, 2326.756958102708, 1133.1262912421244, 4032.158206950185},
      {28, 950.9300867400271, 2326.7569172443546, 1037.2223255160652, 4032.158084247536},
      {49, 834.7632591037507, 2326.756869814297, 849.0705662042777, 4032.1579418087836},
      {98, 804.0495956662394, 3242.9300732249258, 819.6372663004861, 4032.1579418087836},
      {99, 798.3702926083578, 4032.157941808783, 798.3702926083578, 4032.1579418087836}};
  for (const auto& p : published) {
    const auto at = static_cast<std::size_t>(p.t);
    EXPECT_NEAR(smoothed.x(0, p.t), p.smoothed, 1e-8 * p.smoothed) << p.t;
    EXPECT_NEAR(smoothed.P[at](0, 0), p.variance, 1e-8 * p.variance) << p.t;
    EXPECT_NEAR(filtered.x(0, p.t), p.filtered, 1e-8 * p.filtered) << p.t;
    EXPECT_NEAR(filtered.P[at](0, 0), p.filtered_variance, 1e-8 * p.filtered_variance) << p.t;
  }
}

TEST(Smoother, SaysWhyItCannot) {
  Random random(3);
  StateSpace m = random_model(random, 2, 0, 1, 1);
  const MatrixXd y = MatrixXd::Ones(1, 9), u(0, 9);
  EXPECT_THROW(smooth_with_lag(m, InitialState::given, y, u, -1), std::invalid_argument);
  EXPECT_THROW(smooth(m, InitialState::given, MatrixXd::Ones(2, 9), u), std::invalid_argument);
  EXPECT_EQ(smooth(m, InitialState::diffuse, y.leftCols(1), u.leftCols(1)).status,
            FilterStatus::undetermined);
  m.A *= 10.0;
  EXPECT_EQ(smooth(m, InitialState::stationary, y, u).status, FilterStatus::unstable);
}

}  // namespace
}  // namespace identikal
