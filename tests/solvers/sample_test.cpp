// Sequential Monte Carlo against a posterior in closed form.
#include "solvers/sample.h"

#include <cmath>
#include <cstdio>
#include <limits>
#include <numbers>
#include <stdexcept>

#include <Eigen/LU>
#include <gtest/gtest.h>

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// theta ~ N(0, 9 I), y = H theta + N(0, I) seen once.
struct Conjugate {
  MatrixXd H;
  VectorXd y;
  PosteriorProblem problem() const {
    PosteriorProblem out;
    const Index d = H.cols();
    out.draw_prior = [d](Random& random) { return VectorXd(3.0 * random.normal(d)); };
    out.log_prior = [](const VectorXd& x) { return -x.squaredNorm() / 18.0; };
    out.log_likelihood = [this](const VectorXd& x) {
      return -0.5 * (y - H * x).squaredNorm() -
             0.5 * static_cast<double>(y.size()) * std::log(2.0 * std::numbers::pi);
    };
    return out;
  }
};

TEST(Sample, GaussianPosteriorAndItsEvidence) {
  Random random(3);
  Conjugate c;
  c.H.resize(12, 4);
  for (Index j = 0; j < 4; ++j) c.H.col(j) = 4.0 * random.normal(12);
  c.H.col(3) = c.H.col(2) + 0.1 * c.H.col(3);  // strongly correlated
  c.y = c.H * VectorXd::LinSpaced(4, -1.0, 2.0) + random.normal(12);
  SampleOptions options;
  options.draws = 4000;
  const PosteriorSample s = sample(c.problem(), options);
  ASSERT_TRUE(s.summary.usable()) << s.summary.message;
  const MatrixXd precision = c.H.transpose() * c.H + MatrixXd::Identity(4, 4) / 9.0;
  const MatrixXd covariance = precision.inverse();
  const VectorXd mean = covariance * c.H.transpose() * c.y;
  const VectorXd sampled = s.draws.rowwise().mean();
  const MatrixXd centred = s.draws.colwise() - sampled;
  const MatrixXd spread = centred * centred.transpose() / 4000.0;
  // 4000 draws, of which at least a quarter count: a standard error of 3 % of a deviation.
  for (Index i = 0; i < 4; ++i) {
    EXPECT_NEAR((sampled[i] - mean[i]) / std::sqrt(covariance(i, i)), 0.0, 0.1) << i;
    EXPECT_NEAR(spread(i, i) / covariance(i, i), 1.0, 0.15) << i;
  }
  const MatrixXd marginal = 9.0 * c.H * c.H.transpose() + MatrixXd::Identity(12, 12);
  const double evidence =
      -0.5 * (std::log(marginal.determinant()) + c.y.dot(marginal.inverse() * c.y) +
              12.0 * std::log(2.0 * std::numbers::pi));
  std::printf("log evidence %.3f, exact %.3f; %d stages, %ld of 4000 draws distinct\n",
              s.log_evidence, evidence, s.stages, static_cast<long>(s.distinct));
  EXPECT_NEAR(s.log_evidence, evidence, 0.2);
  EXPECT_GT(s.distinct, 3500);
  // The same seed gives the same draws.
  EXPECT_EQ(sample(c.problem(), options).draws, s.draws);
}

TEST(Sample, UndefinedLikelihoodsAreLeftOut) {
  PosteriorProblem p;
  p.draw_prior = [](Random& random) { return VectorXd::Constant(1, random.uniform()); };
  p.log_prior = [](const VectorXd& x) {
    return x[0] > 0.0 && x[0] < 1.0 ? 0.0 : -std::numeric_limits<double>::infinity();
  };
  p.log_likelihood = [](const VectorXd& x) {
    return x[0] < 0.25 ? 0.0 : -std::numeric_limits<double>::infinity();
  };
  const PosteriorSample s = sample(p);
  EXPECT_TRUE(s.summary.usable());
  EXPECT_LT(s.draws.maxCoeff(), 0.25);
  EXPECT_NEAR(s.draws.mean(), 0.125, 0.01);
  EXPECT_NEAR(s.log_evidence, std::log(0.25), 0.1);
  p.log_likelihood = [](const VectorXd&) { return -std::numeric_limits<double>::infinity(); };
  EXPECT_EQ(sample(p).summary.termination, Termination::no_progress);
  SampleOptions few;
  few.draws = 5;
  EXPECT_THROW(sample(p, few), std::invalid_argument);
}

TEST(Sample, StopsWhenTold) {
  PosteriorProblem p;
  p.draw_prior = [](Random& random) { return VectorXd::Constant(1, random.uniform()); };
  p.log_prior = [](const VectorXd& x) {
    return x[0] > 0.0 && x[0] < 1.0 ? 0.0 : -std::numeric_limits<double>::infinity();
  };
  p.log_likelihood = [](const VectorXd& x) { return -0.5e6 * (x[0] - 0.5) * (x[0] - 0.5); };
  SampleOptions options;
  int stages = 0;
  options.progress = [&](double temperature) {
    EXPECT_LT(temperature, 1.0);
    return ++stages < 2;
  };
  const PosteriorSample s = sample(p, options);
  EXPECT_EQ(s.summary.termination, Termination::stopped);
  EXPECT_EQ(s.stages, 2);
  EXPECT_FALSE(s.summary.usable());
}

// Every move is heard of, and a time limit ends within a stage.
TEST(Sample, EndsAtItsTimeLimit) {
  PosteriorProblem p;
  p.draw_prior = [](Random& random) { return random.normal(1); };
  p.log_prior = [](const VectorXd& x) { return -0.5 * x.squaredNorm(); };
  p.log_likelihood = [](const VectorXd& x) { return -1e8 * (x[0] - 0.5) * (x[0] - 0.5); };
  SampleOptions options;
  options.max_seconds = 0.0;
  int moves = 0;
  options.moved = [&](double) { return ++moves > 0; };
  const PosteriorSample s = sample(p, options);
  EXPECT_EQ(s.summary.termination, Termination::time_limit);
  EXPECT_EQ(moves, 1);
  options.moved = [&](double) { return false; };
  EXPECT_EQ(sample(p, options).summary.termination, Termination::stopped);
}

}  // namespace
}  // namespace identikal
