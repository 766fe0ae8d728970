#include "solvers/internal/resampling.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

void tempered_weights(const VectorXd& log_likelihood, double step, VectorXd& out) {
  const double largest = log_likelihood.maxCoeff();
  out = log_likelihood.unaryExpr(
      [=](double L) { return std::isfinite(L) ? std::exp(step * (L - largest)) : 0.0; });
}

VectorXd tempered_weights(const VectorXd& log_likelihood, double step) {
  VectorXd out;
  tempered_weights(log_likelihood, step, out);
  return out;
}

double effective_share(const VectorXd& w) {
  return w.sum() * w.sum() / (w.squaredNorm() * static_cast<double>(w.size()));
}

// The largest rise that leaves half of the draws effective, or what is left to 1.
double next_step(const VectorXd& log_likelihood, double left) {
  constexpr double kShare = 0.5;
  // Draws of the prior without a likelihood cannot be effective at any temperature.
  const double most = static_cast<double>((log_likelihood.array() > -HUGE_VAL).count()) /
                      static_cast<double>(log_likelihood.size());
  const auto enough = [&](double step) {
    return effective_share(tempered_weights(log_likelihood, step)) >= kShare * most;
  };
  if (enough(left)) return left;
  double low = 0.0, high = left;
  for (int i = 0; i < 60; ++i) (enough(0.5 * (low + high)) ? low : high) = 0.5 * (low + high);
  return std::max(low, 1e-12);
}

// Positions of n draws by systematic resampling.
std::vector<Index> resampled(const VectorXd& w, Random& random) {
  const Index n = w.size();
  const double pitch = w.sum() / static_cast<double>(n);
  double at = random.uniform() * pitch, sum = w[0];
  std::vector<Index> out;
  for (Index i = 0, from = 0; i < n; ++i, at += pitch) {
    while (sum < at && from + 1 < n) sum += w[++from];
    out.push_back(from);
  }
  return out;
}

// A factor of the draws' covariance; directions in which all agree get a little.
MatrixXd spread(const MatrixXd& draws) {
  const VectorXd mean = draws.rowwise().mean();
  const MatrixXd centred = draws.colwise() - mean;
  MatrixXd covariance = centred * centred.transpose() / static_cast<double>(draws.cols());
  const VectorXd floor = 1e-12 * (covariance.diagonal() + 1e-12 * mean.cwiseAbs2());
  covariance.diagonal() += floor.cwiseMax(1e-300);
  return covariance.llt().matrixL();
}

}  // namespace identikal
