// Steps by the observed curvature, where the expected information says nothing of it.
#include "solvers/observed_newton.h"

#include <cmath>
#include <stdexcept>

#include <gtest/gtest.h>

#include "lib/base/constants.h"

namespace identikal {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

LikelihoodProblem in_box(Eigen::Index n, double half) {
  LikelihoodProblem out;
  out.lower = VectorXd::Constant(n, -half);
  out.upper = VectorXd::Constant(n, half);
  return out;
}

// -log(1 + c a^2) / 2 - 50 (b - 1 - k a)^2: a spike at a = 0 as under a start of variance c. The
// information that is expected of it vanishes there.
LikelihoodProblem spike(double c, double k) {
  LikelihoodProblem out = in_box(2, 10.0);
  out.evaluate = [=](const VectorXd& x, double& L, VectorXd* g, MatrixXd* J) {
    const double v = 1.0 + c * x[0] * x[0], off = x[1] - 1.0 - k * x[0];
    L = -0.5 * std::log(v) - 50.0 * off * off;
    const double by_a = -c * x[0] / v;
    if (g != nullptr) *g = VectorXd{{by_a + 100.0 * k * off, -100.0 * off}};
    if (J != nullptr) {
      *J = 100.0 * MatrixXd{{k * k, -k}, {-k, 1.0}};
      (*J)(0, 0) += 2.0 * by_a * by_a;
    }
    return true;
  };
  return out;
}

TEST(ObservedNewton, ArrivesAtASpike) {
  const VectorXd start{{3e-4, -2.0}};
  SolverOptions options;
  options.decrement_tolerance = 1e-13;
  options.acceptable_decrement = 1e-4;
  for (const double k : {0.0, 3.0}) {
    SCOPED_TRACE(k);
    const Solution end = maximise_by_curvature(spike(1e9, k), start, options);
    EXPECT_EQ(end.summary.termination, Termination::converged) << end.summary.message;
    EXPECT_NEAR(end.summary.objective, 0.0, 1e-9);
    EXPECT_NEAR(end.x[0], 0.0, 1e-9);
    EXPECT_NEAR(end.x[1], 1.0, 1e-8);
  }
  // Scoring does not: its steps are too long by the vanishing information.
  EXPECT_FALSE(maximise(spike(1e9, 0.0), start, options).summary.usable());
}

TEST(ObservedNewton, LeavesASaddle) {
  LikelihoodProblem problem = in_box(2, 5.0);  // maxima at (1, 0) and (-1, 0)
  problem.evaluate = [](const VectorXd& x, double& L, VectorXd* g, MatrixXd*) {
    const double s = x[0] * x[0] - 1.0;
    L = -s * s - x[1] * x[1];
    if (g != nullptr) *g = VectorXd{{-4.0 * s * x[0], -2.0 * x[1]}};
    return true;
  };
  const Solution end = maximise_by_curvature(problem, VectorXd{{1e-3, 2.0}});
  EXPECT_TRUE(end.summary.usable()) << end.summary.message;
  EXPECT_NEAR(end.x[0], 1.0, 1e-6);
  EXPECT_NEAR(end.x[1], 0.0, 1e-6);
}

TEST(ObservedNewton, EndsAtABoundAndIsToldWhereThereIsNoMaximum) {
  LikelihoodProblem problem = in_box(2, 1.0);
  problem.evaluate = [](const VectorXd& x, double& L, VectorXd* g, MatrixXd*) {
    L = 3.0 * x[0] - (x[1] - 0.5) * (x[1] - 0.5);
    if (g != nullptr) *g = VectorXd{{3.0, -2.0 * (x[1] - 0.5)}};
    return true;
  };
  const Solution end = maximise_by_curvature(problem, VectorXd::Zero(2));
  EXPECT_TRUE(end.summary.usable()) << end.summary.message;
  EXPECT_EQ(end.x[0], 1.0);
  EXPECT_NEAR(end.x[1], 0.5, 1e-9);

  problem.lower[0] = -kInfinity;
  problem.upper[0] = kInfinity;
  problem.evaluate = [](const VectorXd& x, double& L, VectorXd* g, MatrixXd*) {
    L = x[0] - std::exp(-x[0]);  // rises for ever
    if (g != nullptr) *g = VectorXd{{1.0 + std::exp(-x[0]), 0.0}};
    return true;
  };
  EXPECT_FALSE(maximise_by_curvature(problem, VectorXd::Zero(2)).summary.usable());
}

TEST(ObservedNewton, SaysWhyItEnds) {
  LikelihoodProblem undefined = in_box(1, 1.0);
  undefined.evaluate = [](const VectorXd&, double&, VectorXd*, MatrixXd*) { return false; };
  EXPECT_EQ(maximise_by_curvature(undefined, VectorXd::Zero(1)).summary.termination,
            Termination::start_undefined);
  SolverOptions options;
  options.progress = [](int, double) { return false; };
  const VectorXd start{{1e-3, 0.0}};
  EXPECT_EQ(maximise_by_curvature(spike(1e4, 1.0), start, options).summary.termination,
            Termination::stopped);
  EXPECT_THROW(maximise_by_curvature(spike(1.0, 1.0), VectorXd::Zero(3)), std::invalid_argument);
  EXPECT_THROW(maximise_by_curvature(spike(1.0, 1.0), VectorXd::Constant(2, 11.0)),
               std::invalid_argument);
}

}  // namespace
}  // namespace identikal
