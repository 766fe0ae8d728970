#include "solvers/scoring.h"

#include <cmath>

#include <Eigen/LU>
#include <gtest/gtest.h>

#include "lib/base/constants.h"
#include "solvers/covariance.h"
#include "solvers/solve.h"

namespace identikal {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// Independent groups of samples with variances q_i: L = -1/2 sum n_i (log v_i + s_i / v_i), v = M
// q.
LikelihoodProblem variances(const MatrixXd& M, const VectorXd& s, double n) {
  LikelihoodProblem p;
  p.lower = VectorXd::Zero(M.cols());
  p.upper = VectorXd::Constant(M.cols(), kInfinity);
  p.evaluate = [=](const VectorXd& q, double& L, VectorXd* g, MatrixXd* J) {
    const VectorXd v = M * q;
    if (v.minCoeff() <= 0.0) return false;
    L = -0.5 * n * (v.array().log() + s.array() / v.array()).sum();
    const VectorXd dv = 0.5 * n * (s.array() / v.array().square() - 1.0 / v.array());
    if (g != nullptr) *g = M.transpose() * dv;
    if (J != nullptr) *J = M.transpose() * (0.5 * n / v.array().square()).matrix().asDiagonal() * M;
    return true;
  };
  return p;
}

TEST(Scoring, OneStepFromAnywhereWhenVariancesAreSeparate) {
  const VectorXd s = Eigen::Vector2d(15098.0, 0.3);
  for (const double start : {1e-6, 1.0, 1e8}) {
    SolverOptions options;
    options.decrement_tolerance = 1e-20;
    const Solution x = maximise(variances(MatrixXd::Identity(2, 2), s, 100),
                                VectorXd::Constant(2, start), options);
    EXPECT_EQ(x.summary.termination, Termination::converged);
    EXPECT_LE(x.summary.iterations, 3);  // the second only mends rounding
    EXPECT_NEAR(x.x[0] / s[0], 1.0, 1e-9);
    EXPECT_NEAR(x.x[1] / s[1], 1.0, 1e-9);
  }
}

TEST(Scoring, ReachesZeroAndLeavesIt) {
  // Sample variances 1 and 0.4 of q1 + q2 and q1: the maximum without a box has q2 > 0; swapped it
  // is at q2 = 0.
  const MatrixXd M = (MatrixXd(2, 2) << 1, 1, 1, 0).finished();
  const Solution inside =
      maximise(variances(M, Eigen::Vector2d(1.0, 0.4), 50), Eigen::Vector2d(3.0, 0.0));
  EXPECT_EQ(inside.summary.termination, Termination::converged);
  EXPECT_NEAR(inside.x[1], 0.6, 1e-9);
  const Solution at_bound =
      maximise(variances(M, Eigen::Vector2d(0.4, 1.0), 50), Eigen::Vector2d(3.0, 5.0));
  EXPECT_EQ(at_bound.summary.termination, Termination::converged);
  EXPECT_EQ(at_bound.x[1], 0.0);
  EXPECT_NEAR(at_bound.x[0], 0.7, 1e-9);
}

TEST(Scoring, AgreesWithLbfgs) {
  const MatrixXd M = (MatrixXd(4, 3) << 1, 0.2, 0, 0.5, 1, 0.1, 0, 2, 1, 1, 1, 1).finished();
  const LikelihoodProblem p = variances(M, Eigen::Vector4d(2, 1.5, 4, 3.3), 200);
  Minimization negative;
  negative.lower = VectorXd::Constant(3, 1e-9);
  negative.upper = p.upper;
  negative.evaluate = [&p](const VectorXd& x, double& f, VectorXd* g) {
    VectorXd gradient;
    if (!p.evaluate(x, f, &gradient, nullptr)) return false;
    f = -f;
    if (g != nullptr) *g = -gradient;
    return true;
  };
  const Solution a = maximise(p, VectorXd::Ones(3)), b = solve(negative, VectorXd::Ones(3));
  EXPECT_NEAR(a.summary.objective, -b.summary.objective, 1e-8);
  EXPECT_TRUE(a.x.isApprox(b.x, 1e-4));
}

TEST(Scoring, FlatDirectionsGetNoStep) {
  const MatrixXd M = (MatrixXd(2, 2) << 1, 1, 1, 1).finished();
  const Solution x = maximise(variances(M, Eigen::Vector2d(2, 2), 50), Eigen::Vector2d(1.0, 5.0));
  EXPECT_EQ(x.summary.termination, Termination::converged);
  EXPECT_NEAR(x.x.sum(), 2.0, 1e-6);
}

// What a long recording does: digits of L and of its gradient that say nothing.
TEST(Scoring, ArrivesThoughDigitsAreNoise) {
  const LikelihoodProblem exact = variances(MatrixXd::Identity(2, 2), Eigen::Vector2d(2, 3), 1e6);
  for (const double noise : {1e-9, 1e-7, 1e-5}) {
    LikelihoodProblem p = exact;
    p.evaluate = [&](const VectorXd& x, double& L, VectorXd* g, MatrixXd* J) {
      if (!exact.evaluate(x, L, g, J)) return false;
      const double wave = std::sin(1e9 * x.sum());  // seeded by nothing but x
      L += noise * wave;
      if (g != nullptr) *g += 1e6 * noise * wave * VectorXd::Ones(2);
      return true;
    };
    SolverOptions options;
    options.decrement_tolerance = 1e-15;
    options.acceptable_decrement = 1e-4;
    const Solution x = maximise(p, Eigen::Vector2d(20.0, 0.1), options);
    EXPECT_EQ(x.summary.termination, Termination::converged) << noise;
    EXPECT_NEAR(x.x[0], 2.0, 1e-4);  // a thirtieth of a standard error
    EXPECT_NEAR(x.x[1], 3.0, 1e-4);
    EXPECT_LT(x.summary.evaluations, 40);
  }
}

// A likelihood that rises for ever, ever more slowly, along what it does not determine.
TEST(Scoring, ARidgeWithoutAnEndIsNoFailure) {
  LikelihoodProblem p;
  p.lower = VectorXd::Constant(2, -kInfinity);
  p.upper = VectorXd::Constant(2, kInfinity);
  p.evaluate = [](const VectorXd& x, double& L, VectorXd* g, MatrixXd* J) {
    const double v = x[1] > 0.0 ? x[1] : 1e-3;
    L = -50.0 * (x[0] - 1.0) * (x[0] - 1.0) - 1.0 / v;
    if (g != nullptr) *g = Eigen::Vector2d(-100.0 * (x[0] - 1.0), 1.0 / (v * v));
    if (J != nullptr) *J = Eigen::Vector2d(100.0, 2.0 / (v * v * v)).asDiagonal();
    return x[1] > 0.0;
  };
  SolverOptions options;
  options.decrement_tolerance = 1e-15;
  options.acceptable_decrement = 1e-4;
  const Solution x = maximise(p, Eigen::Vector2d(3.0, 1.0), options);
  EXPECT_EQ(x.summary.termination, Termination::converged);
  EXPECT_NEAR(x.x[0], 1.0, 1e-6);
  EXPECT_GT(x.summary.objective, -2e-3);
}

// Information fifty times the curvature that there is: steps that are too short every time.
TEST(Scoring, DoesNotCrawlWhereStepsPromiseTooLittle) {
  LikelihoodProblem p;
  p.lower = VectorXd::Zero(1);
  p.upper = VectorXd::Constant(1, kInfinity);
  p.evaluate = [](const VectorXd& x, double& L, VectorXd* g, MatrixXd* J) {
    L = -0.5 * std::pow(x[0] - 3.0, 2);
    if (g != nullptr) *g = VectorXd::Constant(1, 3.0 - x[0]);
    if (J != nullptr) *J = MatrixXd::Constant(1, 1, 50.0);
    return true;
  };
  SolverOptions options;
  options.decrement_tolerance = 1e-12;
  const Solution solution = maximise(p, VectorXd::Constant(1, 1000.0), options);
  EXPECT_TRUE(solution.summary.usable());
  EXPECT_NEAR(solution.x[0], 3.0, 1e-4);
  EXPECT_LT(solution.summary.evaluations, 100);  // one by one: several hundred
}

// Information a fifth of the curvature that there is, far from the maximum and near it, as where the
// noise is not what the model says: steps that are five times too long, one way and back.
TEST(Scoring, DoesNotGoBackAndForthWhereStepsAreTooLong) {
  for (const double samples : {1.0, 1e4}) {
    LikelihoodProblem p;
    p.lower = VectorXd::Constant(2, -kInfinity);
    p.upper = VectorXd::Constant(2, kInfinity);
    const MatrixXd curvature = samples * MatrixXd{{5.0, 2.0}, {2.0, 1.0}};
    p.evaluate = [&](const VectorXd& x, double& L, VectorXd* g, MatrixXd* J) {
      const double bend = 1.0 + 0.1 * std::sin(x[0]);
      L = -0.5 * bend * x.dot(curvature * x);
      if (g != nullptr) {
        *g = -bend * curvature * x;
        (*g)[0] -= 0.05 * std::cos(x[0]) * x.dot(curvature * x);
      }
      if (J != nullptr) *J = 0.2 * curvature;
      return true;
    };
    const Solution solution = maximise(p, VectorXd{{30.0, -70.0}});
    printf("information too small by 5, %g samples: %d evaluations\n", samples,
           solution.summary.evaluations);
    EXPECT_TRUE(solution.summary.usable());
    EXPECT_NEAR(solution.summary.objective, 0.0, 1e-4);
    EXPECT_LT(solution.summary.evaluations, 40);
  }
}

// A variance a thousand times too large beside one that is right, at an information that sends it to
// zero, where there is no likelihood to speak of.
TEST(Scoring, AVarianceThatIsDecadesTooLargeComesDownByFactors) {
  LikelihoodProblem p;
  p.lower = VectorXd::Zero(1);
  p.upper = VectorXd::Constant(1, kInfinity);
  p.evaluate = [](const VectorXd& x, double& L, VectorXd* g, MatrixXd* J) {
    const double v = std::max(x[0], 1e-9);
    L = -500.0 * (std::log(v) + 1.0 / v);
    if (g != nullptr) *g = VectorXd::Constant(1, -500.0 / v * (1.0 - 1.0 / v));
    if (J != nullptr) *J = MatrixXd::Constant(1, 1, 100.0 / (v * v));
    return true;
  };
  const Solution solution = maximise(p, VectorXd::Constant(1, 1000.0));
  printf("from a thousand times too much: %d evaluations\n", solution.summary.evaluations);
  EXPECT_NEAR(solution.x[0], 1.0, 1e-3);
  EXPECT_LT(solution.summary.evaluations, 40);
}

TEST(Scoring, SaysWhyItStopped) {
  const LikelihoodProblem p = variances(MatrixXd::Identity(1, 1), VectorXd::Ones(1), 10);
  EXPECT_EQ(maximise(p, VectorXd::Zero(1)).summary.termination, Termination::start_undefined);
  SolverOptions none;
  none.max_iterations = 0;
  EXPECT_EQ(maximise(p, VectorXd::Constant(1, 5.0), none).summary.termination,
            Termination::iteration_limit);
  EXPECT_THROW(maximise(p, VectorXd::Constant(1, -1.0)), std::invalid_argument);
  EXPECT_EQ(SolverSummary{}.message, "solve was not called");
}

TEST(Covariance, RefusesRankLossAndInverts) {
  MatrixXd J(2, 2);
  J << 4e12, 1e3, 1e3, 1e-4;
  const auto inverse = scaled_inverse(J);
  ASSERT_TRUE(inverse.has_value());
  const double det = J.determinant();
  EXPECT_NEAR((*inverse)(0, 0) * det / J(1, 1), 1.0, 1e-12);
  EXPECT_NEAR((*inverse)(0, 1) * det / -J(0, 1), 1.0, 1e-12);
  EXPECT_NEAR((*inverse)(1, 1) * det / J(0, 0), 1.0, 1e-12);
  J << 1, 1, 1, 1;
  EXPECT_FALSE(scaled_inverse(J).has_value());
}

}  // namespace
}  // namespace identikal
