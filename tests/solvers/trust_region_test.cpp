#include "solvers/trust_region.h"

#include <cmath>
#include <functional>
#include <stdexcept>

#include <gtest/gtest.h>

#include "lib/base/random.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Residuals and their Jacobian.
using Residuals = std::function<void(const VectorXd& p, VectorXd& r, MatrixXd& J)>;

// -n/2 log(r'r/n), as the likelihood is once the variance is the best there is.
LikelihoodProblem profiled(const Residuals& residuals, Index unknowns) {
  LikelihoodProblem out;
  out.lower = VectorXd::Constant(unknowns, -INFINITY);
  out.upper = -out.lower;
  out.evaluate = [residuals](const VectorXd& p, double& L, VectorXd* g, MatrixXd* H) {
    VectorXd r;
    MatrixXd J;
    residuals(p, r, J);
    if (!r.allFinite() || !J.allFinite()) return false;
    const auto n = static_cast<double>(r.size());
    const double variance = r.squaredNorm() / n;
    L = -0.5 * n * std::log(variance);
    if (g) *g = -J.transpose() * r / variance;
    if (H) *H = J.transpose() * J / variance;
    return true;
  };
  return out;
}

// The resistance of a thermistor, y = a exp(b/(t + c)): one curved valley, decades long.
Residuals thermistor(const VectorXd& t, const VectorXd& y) {
  return [=](const VectorXd& p, VectorXd& r, MatrixXd& J) {
    const Eigen::ArrayXd by = 1.0 / (t.array() + p[2]), model = p[0] * (p[1] * by).exp();
    r = model.matrix() - y;
    J.resize(t.size(), 3);
    J.col(0) = (p[1] * by).exp();
    J.col(1) = model * by;
    J.col(2) = -model * p[1] * by.square();
  };
}

TEST(TrustRegion, LeavesAStartThatIsDecadesOff) {
  const VectorXd t = VectorXd::LinSpaced(16, 50.0, 125.0);
  const VectorXd truth = Eigen::Vector3d(0.0056, 6180.0, 345.0);
  VectorXd y(t.size());
  Random random(3);
  for (Index i = 0; i < t.size(); ++i) {
    y[i] = truth[0] * std::exp(truth[1] / (t[i] + truth[2])) + 2.0 * random.normal();
  }
  const LikelihoodProblem problem = profiled(thermistor(t, y), 3);
  for (const Eigen::Vector3d& start :
       {Eigen::Vector3d(2.0, 4e5, 2.5e4), Eigen::Vector3d(0.02, 4000.0, 250.0)}) {
    const Solution near =
        maximise_from_afar(problem, start, 16.0, {.max_iterations = 2000, .progress = {}});
    EXPECT_EQ(near.summary.termination, Termination::converged);
    EXPECT_LT((near.x.array() / truth.array() - 1.0).abs().maxCoeff(), 0.05);
    const Solution best = maximise(problem, near.x);
    EXPECT_NEAR(best.summary.objective, near.summary.objective, 1e-6);
  }
}

// A unit of its own for every unknown changes nothing but the rounding.
TEST(TrustRegion, UnitsDoNotMatter) {
  const VectorXd t = VectorXd::LinSpaced(30, 0.0, 10.0);
  const VectorXd y = 3.0 * (-0.7 * t.array()).exp() + 1.0 * (-0.05 * t.array()).exp() +
                     0.01 * (17.0 * t.array()).sin();
  const auto decay = [&](double unit) {
    return profiled(
        [=](const VectorXd& scaled, VectorXd& r, MatrixXd& J) {
          const VectorXd p = scaled.cwiseProduct(VectorXd{{1.0, unit, 1.0, 1.0 / unit}});
          const Eigen::ArrayXd one = (-p[1] * t.array()).exp(), two = (-p[3] * t.array()).exp();
          r = (p[0] * one + p[2] * two).matrix() - y;
          J.resize(t.size(), 4);
          J.col(0) = one;
          J.col(1) = -p[0] * t.array() * one * unit;
          J.col(2) = two;
          J.col(3) = -p[2] * t.array() * two / unit;
        },
        4);
  };
  const VectorXd start{{1.0, 2.0, 2.0, 0.5}};
  const Solution plain = maximise_from_afar(decay(1.0), start, 30.0);
  const Solution scaled =
      maximise_from_afar(decay(1e6), start.cwiseProduct(VectorXd{{1.0, 1e-6, 1.0, 1e6}}), 30.0);
  EXPECT_EQ(plain.summary.termination, Termination::converged);
  EXPECT_NEAR(plain.summary.objective, scaled.summary.objective, 1e-6);
  EXPECT_NEAR(plain.x[1], 1e6 * scaled.x[1], 1e-6);
}

TEST(TrustRegion, StaysInTheBox) {
  LikelihoodProblem problem = profiled(
      [](const VectorXd& p, VectorXd& r, MatrixXd& J) {
        r = VectorXd{{10.0 * (p[1] - p[0] * p[0]), 1.0 - p[0], 0.3}};  // Rosenbrock
        J = MatrixXd{{-20.0 * p[0], 10.0}, {-1.0, 0.0}, {0.0, 0.0}};
      },
      2);
  problem.lower = Eigen::Vector2d(-2.0, -1.0);
  problem.upper = Eigen::Vector2d(0.8, 2.0);
  const Solution found = maximise_from_afar(problem, Eigen::Vector2d(-1.2, 1.0), 3.0);
  EXPECT_EQ(found.summary.termination, Termination::converged);
  EXPECT_EQ(found.x[0], 0.8);
  EXPECT_NEAR(found.x[1], 0.64, 1e-6);
  EXPECT_THROW(maximise_from_afar(problem, Eigen::Vector2d(3.0, 1.0), 3.0), std::invalid_argument);
  EXPECT_THROW(maximise_from_afar(problem, Eigen::Vector2d(0.0, 1.0), 0.0), std::invalid_argument);
}

}  // namespace
}  // namespace identikal
