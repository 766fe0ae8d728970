// Impulse responses by kernels and their realisation, against dense linear algebra and systems that are known.
#include <cmath>

#include <Eigen/Dense>
#include <gtest/gtest.h>

#include "lib/base/random.h"
#include "lib/subspace/impulse_realisation.h"
#include "lib/subspace/impulse_regression.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

LaggedProducts sums_of(Index rows, Index lags, MatrixXd& regressors, VectorXd& targets) {
  Random random(1);
  MatrixXd u(2, rows), y(1, rows);
  for (double& each : u.reshaped()) each = random.normal();
  for (Index t = 0; t < rows; ++t) {
    y(0, t) = 0.2 * random.normal() + (t > 0 ? u(0, t - 1) : 0.0) - 0.5 * u(1, t);
  }
  regressors.resize(rows - lags, 2 * (lags + 1));
  targets = y.row(0).tail(rows - lags).transpose();
  for (Index t = lags; t < rows; ++t) {
    for (Index j = 0; j < 2; ++j) {
      for (Index k = 0; k <= lags; ++k) regressors(t - lags, j * (lags + 1) + k) = u(j, t - k);
    }
  }
  return lagged_products({y}, {u}, lags);
}

TEST(ImpulseRegression, IsTheGaussianPosteriorOfEveryKernel) {
  constexpr Index kLags = 12, kRows = 80;
  MatrixXd X;
  VectorXd y;
  const ImpulseRegression regression(sums_of(kRows, kLags, X, y));
  double first_difference = 0.0;
  bool is_first = true;
  for (const KernelPrior& prior : {KernelPrior{Kernel::tuned_correlated, 2.0, 0.8},
                                   KernelPrior{Kernel::diagonal_correlated, 2.0, 0.8, 0.6},
                                   KernelPrior{Kernel::stable_spline, 5.0, 0.9}}) {
    const Index n = kLags + 1;
    MatrixXd K = MatrixXd::Zero(2 * n, 2 * n);
    K.topLeftCorner(n, n) = K.bottomRightCorner(n, n) = kernel_matrix(prior, n);
    EXPECT_GT(Eigen::SelfAdjointEigenSolver<MatrixXd>(K).eigenvalues()[0], -1e-12);
    const MatrixXd M = MatrixXd::Identity(y.size(), y.size()) + X * K * X.transpose();
    const double variance = y.dot(M.ldlt().solve(y)) / static_cast<double>(y.size());
    const double dense =
        -0.5 * static_cast<double>(y.size()) * std::log(variance) - 0.5 * std::log(M.determinant());
    // Up to what is the same for all priors.
    const double difference = dense - regression.log_evidence(prior);
    if (is_first) first_difference = difference;
    is_first = false;
    EXPECT_NEAR(difference, first_difference, 1e-6);
    const ImpulseRegression::Responses found = regression.estimate(prior);
    const VectorXd mean = K * X.transpose() * M.ldlt().solve(y);
    const MatrixXd covariance = variance * (K - K * X.transpose() * M.ldlt().solve(X * K));
    EXPECT_LT((found.value.col(0) - mean).cwiseAbs().maxCoeff(), 1e-7);
    EXPECT_LT((found.se.col(0) - covariance.diagonal().cwiseSqrt()).cwiseAbs().maxCoeff(), 1e-7);
  }
}

TEST(ImpulseRegression, KnowsItsKernels) {
  const MatrixXd tc = kernel_matrix({Kernel::tuned_correlated, 2.0, 0.5}, 3);
  EXPECT_DOUBLE_EQ(tc(0, 2), 2.0 * 0.125);
  const MatrixXd dc = kernel_matrix({Kernel::diagonal_correlated, 2.0, 0.5, std::sqrt(0.5)}, 3);
  EXPECT_LT((tc - dc).cwiseAbs().maxCoeff(), 1e-15);
  const MatrixXd ss = kernel_matrix({Kernel::stable_spline, 1.0, 0.5}, 2);
  EXPECT_DOUBLE_EQ(ss(0, 1), std::pow(0.5, 5) / 2.0 - std::pow(0.5, 6) / 6.0);
  KernelPrior slow{Kernel::diagonal_correlated, 2.0, 0.5, 0.6};
  const double before = kernel_matrix(slow, 4)(1, 3);
  slow.slow_size = 0.1;
  slow.slow_correlation = 0.8;
  EXPECT_NEAR(kernel_matrix(slow, 4)(1, 3) - before, 0.1 * std::exp(-2.0) * 0.64, 1e-15);
}

std::vector<MatrixXd> responses(const InnovationForm& model, int count) {
  std::vector<MatrixXd> out{model.D};
  MatrixXd x = model.B;
  for (int k = 1; k < count; ++k) {
    out.push_back(model.C * x);
    x = model.A * x;
  }
  return out;
}

TEST(ImpulseRealisation, FindsAModelFromItsResponses) {
  InnovationForm truth;
  truth.A = MatrixXd{{0.8, 0.3, 0.0}, {-0.3, 0.8, 0.0}, {0.0, 0.0, 0.5}};
  truth.B = MatrixXd{{1.0, 0.0}, {0.5, -1.0}, {1.0, 1.0}};
  truth.C = MatrixXd{{1.0, 0.2, 1.0}};
  truth.D = MatrixXd{{0.0, 0.3}};
  const ImpulseRealisation realisation(responses(truth, 40));
  EXPECT_EQ(realisation.most_states(), 3);
  const InnovationForm found = realisation.model(3);
  const std::vector<MatrixXd> of_truth = responses(truth, 60), of_found = responses(found, 60);
  for (std::size_t k = 0; k < of_truth.size(); ++k)
    EXPECT_LT((of_truth[k] - of_found[k]).cwiseAbs().maxCoeff(), 1e-10) << k;
  // Two states are near where the third is small: the balanced reduction loses at most about twice what is left out.
  const std::vector<MatrixXd> reduced = responses(realisation.model(2), 60);
  EXPECT_LT((reduced[5] - of_truth[5]).norm(), 2.5 * realisation.singular_values()[2]);
  EXPECT_THROW(realisation.model(4), std::invalid_argument);
  EXPECT_THROW(ImpulseRealisation({truth.D, truth.D}), std::invalid_argument);
}

}  // namespace
}  // namespace identikal
