#include "lib/nonlinear/smoother.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <stdexcept>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <gtest/gtest.h>

#include "lib/base/constants.h"
#include "lib/base/random.h"
#include "lib/nonlinear/simulation.h"
#include "tests/support/written_model.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

NonlinearFilterOptions options_of(NonlinearMethod method, ProcessNoise noise) {
  NonlinearFilterOptions out;
  out.method = method;
  out.noise = noise;
  return out;
}

TEST(NonlinearSmoother, LinearModelsHaveTheSmoothersNumbers) {
  const NonlinearModel model =
      make_nonlinear_model(formulas_of({{"a", "b"},
                                        {"u"},
                                        {"p"},
                                        {"p*a + b + u", "-0.3*a + 0.4*b + 0.2"},
                                        {"a + 0.5*u + 1", "b - a"},
                                        {},
                                        false}));
  const double p = 0.7;
  StateSpace matrices;
  matrices.A = (MatrixXd(2, 2) << p, 1.0, -0.3, 0.4).finished();
  matrices.B = (MatrixXd(2, 2) << 1.0, 0.0, 0.0, 0.2).finished();
  matrices.C = (MatrixXd(2, 2) << 1.0, 0.0, -1.0, 1.0).finished();
  matrices.D = (MatrixXd(2, 2) << 0.5, 1.0, 0.0, 0.0).finished();
  matrices.G = MatrixXd::Identity(2, 2);
  FilterNoise noise = zero_noise(model);
  // Of rank one: P_pred has no inverse at the second sample.
  noise.Q = (MatrixXd(2, 2) << 1.0, 0.5, 0.5, 0.25).finished();
  noise.R = (MatrixXd(2, 2) << 2.0, 0.3, 0.3, 1.0).finished();
  noise.x0 = Eigen::Vector2d(1.0, -2.0);
  matrices.Q = noise.Q;
  matrices.R = noise.R;
  matrices.S = MatrixXd::Zero(2, 2);
  matrices.x0 = noise.x0;
  matrices.P0 = noise.P0;
  const Index N = 120;
  Random random(3);
  MatrixXd u(1, N), y(2, N);
  for (double& entry : u.reshaped()) entry = random.normal();
  for (double& entry : y.reshaped()) entry = random.uniform() < 0.2 ? kNaN : 3.0 * random.normal();
  y.col(N - 1).setConstant(kNaN);
  MatrixXd with_one(2, N);
  with_one << u, MatrixXd::Ones(1, N);
  const InputNodes inputs = input_nodes(VectorXd::LinSpaced(N, 0.0, static_cast<double>(N - 1)), u,
                                        InputPath::constant, kInfinity);
  const VectorXd parameters = VectorXd::Constant(1, p);
  for (const NonlinearMethod method :
       {NonlinearMethod::extended, NonlinearMethod::iterated, NonlinearMethod::unscented}) {
    const NonlinearFilterOptions options = options_of(method, ProcessNoise::per_sample);
    const SmootherResult all = nonlinear_smoother(model, parameters, noise, inputs, y, options);
    const SmootherResult expected = smooth(matrices, InitialState::given, y, with_one);
    const SmootherResult lagged =
        nonlinear_smoother(model, parameters, noise, inputs, y, options, 4);
    const SmootherResult expected_lagged =
        smooth_with_lag(matrices, InitialState::given, y, with_one, 4);
    ASSERT_EQ(all.status, FilterStatus::ok);
    EXPECT_NEAR(all.log_likelihood, expected.log_likelihood,
                1e-11 * std::abs(expected.log_likelihood));
    const double x = (all.x - expected.x).cwiseAbs().maxCoeff(),
                 sd = (all.sd - expected.sd).cwiseAbs().maxCoeff(),
                 late = (lagged.x - expected_lagged.x).cwiseAbs().maxCoeff();
    std::printf("states %.1e, deviations %.1e, lagged %.1e\n", x, sd, late);
    EXPECT_LT(std::max({x, sd, late}), 1e-11);
    EXPECT_LT((all.P[7] - expected.P[7]).norm(), 1e-11);
  }
}

// A pendulum in large swings, seen through its sine.
struct Swing {
  NonlinearModel model = make_nonlinear_model(formulas_of({{"phi", "w"},
                                                           {},
                                                           {"l"},
                                                           {"w", "-9.81/l*sin(phi) - 0.1*w"},
                                                           {"l*sin(phi)", "w + 0.2*w^2"},
                                                           {},
                                                           true}));
  VectorXd p = VectorXd::Constant(1, 0.8);
  FilterNoise noise = zero_noise(model);
  InputNodes inputs;
  NonlinearRealisation truth;

  Swing(Index N, std::uint64_t seed) {
    noise.Q(1, 1) = 0.05;
    noise.R = Eigen::Vector2d(1e-3, 0.04).asDiagonal();
    noise.x0 = Eigen::Vector2d(1.0, 0.0);
    noise.P0 = Eigen::Vector2d(0.01, 0.04).asDiagonal();
    const double dt = 0.05;
    inputs = input_nodes(VectorXd::LinSpaced(N, 0.0, dt * static_cast<double>(N - 1)),
                         MatrixXd(0, N), InputPath::constant, 0.01);
    Random random(seed);
    truth = simulate_nonlinear_outputs(model, p, noise, ProcessNoise::density, inputs, random);
  }
};

// The textbook's recursion, with Phi by differences and P_pred inverted.
TEST(NonlinearSmoother, ItIsTheRauchTungStriebelRecursion) {
  const Index N = 80;
  const Swing swing(N, 5);
  for (const NonlinearMethod method :
       {NonlinearMethod::extended, NonlinearMethod::iterated, NonlinearMethod::unscented}) {
    const NonlinearFilterOptions options = options_of(method, ProcessNoise::density);
    const FilterResult filter =
        nonlinear_filter(swing.model, swing.p, swing.noise, swing.inputs, swing.truth.y, options);
    const SmootherResult found =
        nonlinear_smoother(swing.model, swing.p, swing.noise, swing.inputs, swing.truth.y, options);
    ASSERT_EQ(filter.status, FilterStatus::ok);
    ASSERT_EQ(found.status, FilterStatus::ok);
    EXPECT_NEAR(found.log_likelihood, filter.log_likelihood, 1e-8);
    ModelMemory memory = make_memory(swing.model);
    set_parameters(swing.model, memory, swing.p);
    VectorXd x = filter.x_filt.col(N - 1);
    MatrixXd P = filter.P_filt.back();
    double worst = 0.0, narrower = 0.0;
    for (Index t = N - 1; t >= 0; --t) {
      const auto at = static_cast<std::size_t>(t);
      if (t < N - 1) {
        MatrixXd cross(2, 2);  // cov(x(t), x(t+1))
        if (method == NonlinearMethod::unscented) {
          // The cubature points: alpha = 1, kappa = 0 leave the middle one out of all means.
          const MatrixXd L = filter.P_filt[at].llt().matrixL();
          cross.setZero();
          for (const double side : {-1.0, 1.0}) {
            for (Index j = 0; j < 2; ++j) {
              const VectorXd off = side * std::sqrt(2.0) * L.col(j);
              VectorXd moved = filter.x_filt.col(t) + off;
              step(swing.model, memory, swing.inputs, t, moved);
              cross += 0.25 * off * (moved - filter.x_pred.col(t + 1)).transpose();
            }
          }
        } else {
          MatrixXd Phi(2, 2);
          for (Index j = 0; j < 2; ++j) {
            const double h = 1e-6;
            VectorXd above = filter.x_filt.col(t), below = above;
            above[j] += h;
            below[j] -= h;
            step(swing.model, memory, swing.inputs, t, above);
            step(swing.model, memory, swing.inputs, t, below);
            Phi.col(j) = (above - below) / (2.0 * h);
          }
          cross = filter.P_filt[at] * Phi.transpose();
        }
        const MatrixXd gain = cross * filter.P_pred[at + 1].inverse();
        x = filter.x_filt.col(t) + gain * (x - filter.x_pred.col(t + 1));
        P = filter.P_filt[at] + gain * (P - filter.P_pred[at + 1]) * gain.transpose();
      }
      const VectorXd sd = P.diagonal().cwiseSqrt();
      worst = std::max({worst, (found.x.col(t) - x).cwiseQuotient(sd).cwiseAbs().maxCoeff(),
                        (found.sd.col(t) - sd).cwiseQuotient(sd).cwiseAbs().maxCoeff()});
      narrower = std::max(
          narrower, 1.0 - (sd.array() / filter.P_filt[at].diagonal().array().sqrt()).maxCoeff());
    }
    std::printf("off by %.1e standard deviations; at best %.0f %% narrower than the filter\n",
                worst, 100.0 * narrower);
    EXPECT_LT(worst, 1e-6);
    EXPECT_GT(narrower, 0.2);
  }
}

// Errors over their standard deviations: of 40 recordings, at every 20th sample, so that few share
// their noise. False alarms: 3 in 1000 for each of the two numbers, errors taken as independent.
TEST(NonlinearSmoother, ItsErrorsAreAsLargeAsItSays) {
  double squares = 0.0, samples = 0.0;
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    const Swing swing(101, seed);
    const SmootherResult found =
        nonlinear_smoother(swing.model, swing.p, swing.noise, swing.inputs, swing.truth.y,
                           options_of(NonlinearMethod::extended, ProcessNoise::density));
    ASSERT_EQ(found.status, FilterStatus::ok);
    for (Index t = 10; t < 100; t += 20) {
      const auto at = static_cast<std::size_t>(t);
      const VectorXd off = swing.truth.x.col(t) - found.x.col(t);
      squares += off.dot(found.P[at].inverse() * off);
      samples += 2.0;
    }
  }
  const double mean = squares / samples, scatter = std::sqrt(2.0 / samples);
  std::printf("mean square of standardised errors %.3f, expected 1 +- %.3f\n", mean, scatter);
  EXPECT_NEAR(mean, 1.0, 3.0 * scatter);
}

TEST(NonlinearSmoother, MistakesAreSaid) {
  const Swing swing(10, 1);
  const auto smooth_by = [&](NonlinearMethod method, Index lag) {
    nonlinear_smoother(swing.model, swing.p, swing.noise, swing.inputs, swing.truth.y,
                       options_of(method, ProcessNoise::density), lag);
  };
  EXPECT_THROW(smooth_by(NonlinearMethod::unscented, -1), std::invalid_argument);
  EXPECT_THROW(smooth_by(NonlinearMethod::extended, -1), std::invalid_argument);
  FilterNoise no_noise = swing.noise;
  no_noise.R.setZero();
  no_noise.P0.setZero();
  EXPECT_EQ(nonlinear_smoother(swing.model, swing.p, no_noise, swing.inputs, swing.truth.y,
                               options_of(NonlinearMethod::extended, ProcessNoise::density))
                .status,
            FilterStatus::indefinite);
}

}  // namespace
}  // namespace identikal
