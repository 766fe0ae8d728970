#include "lib/regression/recursive_least_squares.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "lib/base/constants.h"
#include "lib/regression/error_growth.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Pivots over the most their regressor has had alone: at the first forgetting ends. Over what it
// has now: below the second, which rounding alone reaches, nothing is determined.
constexpr double kForgetDownTo = 1e-7;
constexpr double kDeterminedPivot = 1e-10;

double alone(const RecursiveLeastSquares& rls, Index i) { return rls.L.row(i).head(i + 1).norm(); }

bool determines(const RecursiveLeastSquares& rls, Index i) {
  return rls.L(i, i) > kDeterminedPivot * alone(rls, i);
}

void forget(RecursiveLeastSquares& rls, double lambda) {
  const double root = std::sqrt(lambda);
  const Index d = rls.L.rows();
  for (Index i = 0; i < d; ++i) {
    if (rls.L(i, i) <= kForgetDownTo * rls.largest[i]) continue;
    rls.L.col(i).tail(d - i) *= root;
    rls.z.col(i) *= root;
  }
  rls.squares *= lambda;
  rls.weight *= lambda;
  rls.squared_weight *= lambda * lambda;
  rls.prior *= lambda;
}

// L' x = column, in place; undetermined coefficients are 0.
template <typename Column>
void solve_upper(const RecursiveLeastSquares& rls, Column&& x) {
  const Index d = rls.L.rows();
  for (Index i = d - 1; i >= 0; --i) {
    const Index below = d - 1 - i;
    if (!determines(rls, i)) {
      x[i] = 0.0;
    } else {
      x[i] = (x[i] - rls.L.col(i).tail(below).dot(x.tail(below))) / rls.L(i, i);
    }
  }
}

}  // namespace

RecursiveLeastSquares start_recursive_least_squares(Index regressors, Index outputs, double delta) {
  if (regressors < 1 || outputs < 1 || !(delta >= 0.0 && std::isfinite(delta))) {
    throw std::invalid_argument("start_recursive_least_squares: argument out of range");
  }
  RecursiveLeastSquares rls;
  rls.theta = MatrixXd::Zero(regressors, outputs);
  rls.prior_error = rls.posterior_error = rls.squares = rls.sample = VectorXd::Zero(outputs);
  rls.L = std::sqrt(delta) * MatrixXd::Identity(regressors, regressors);
  rls.z = MatrixXd::Zero(outputs, regressors);
  rls.row = VectorXd::Zero(regressors);
  rls.largest = VectorXd::Constant(regressors, std::sqrt(delta));
  rls.prior = delta;
  return rls;
}

bool update(RecursiveLeastSquares& rls, const Eigen::Ref<const VectorXd>& phi,
            const Eigen::Ref<const VectorXd>& y, double lambda) {
  const Index d = rls.L.rows();
  if (!(lambda > 0.0 && lambda <= 1.0)) {
    throw std::invalid_argument("update: the forgetting factor is not in (0, 1]");
  }
  if (phi.size() != d || y.size() != rls.theta.cols()) {
    throw std::invalid_argument("update: regressors or outputs of another size");
  }
  if (!phi.allFinite() || !y.allFinite()) return false;
  rls.prior_error = y;
  rls.prior_error.noalias() -= rls.theta.transpose() * phi;
  forget(rls, lambda);
  rls.row = phi;
  rls.sample = y;
  rls.conversion = 1.0;
  for (Index i = 0; i < d; ++i) {
    const double a = rls.L(i, i), b = rls.row[i];
    if (b == 0.0) continue;
    const double r = std::hypot(a, b), c = a / r, s = b / r;
    rls.L(i, i) = r;
    for (Index k = i + 1; k < d; ++k) {
      const double l = rls.L(k, i);
      rls.L(k, i) = c * l + s * rls.row[k];
      rls.row[k] = c * rls.row[k] - s * l;
    }
    for (Index j = 0; j < y.size(); ++j) {
      const double l = rls.z(j, i);
      rls.z(j, i) = c * l + s * rls.sample[j];
      rls.sample[j] = c * rls.sample[j] - s * l;
    }
    rls.conversion *= c * c;
  }
  for (Index i = 0; i < d; ++i) rls.largest[i] = std::max(rls.largest[i], alone(rls, i));
  rls.squares += rls.sample.cwiseAbs2();
  rls.weight += 1.0;
  rls.squared_weight += 1.0;
  ++rls.samples;
  for (Index j = 0; j < y.size(); ++j) {
    rls.theta.col(j) = rls.z.row(j).transpose();
    solve_upper(rls, rls.theta.col(j));
  }
  rls.posterior_error = y;
  rls.posterior_error.noalias() -= rls.theta.transpose() * phi;
  return true;
}

double leverage(RecursiveLeastSquares& rls, const Eigen::Ref<const VectorXd>& phi) {
  // phi' (L L')^-1 phi = || L^-1 phi ||^2
  double sum = 0.0;
  rls.row = phi;
  for (Index i = 0; i < rls.L.rows(); ++i) {
    rls.row[i] -= rls.L.row(i).head(i).dot(rls.row.head(i));
    if (determines(rls, i)) {
      rls.row[i] /= rls.L(i, i);
    } else if (std::abs(rls.row[i]) > kDeterminedPivot * std::abs(phi[i])) {
      return kInfinity;
    } else {
      rls.row[i] = 0.0;
    }
    sum += rls.row[i] * rls.row[i];
  }
  return sum;
}

bool determined(const RecursiveLeastSquares& rls) {
  for (Index i = 0; i < rls.L.rows(); ++i) {
    if (!determines(rls, i)) return false;
  }
  return true;
}

MatrixXd inverse_correlation(const RecursiveLeastSquares& rls) {
  const Index d = rls.L.rows();
  if (!determined(rls)) return MatrixXd::Constant(d, d, kInfinity);
  const MatrixXd inverse = rls.L.triangularView<Eigen::Lower>().solve(MatrixXd::Identity(d, d));
  return inverse.transpose() * inverse;
}

VectorXd gain(const RecursiveLeastSquares& rls, const Eigen::Ref<const VectorXd>& phi) {
  if (!determined(rls)) return VectorXd::Constant(phi.size(), kInfinity);
  VectorXd out = phi;
  rls.L.triangularView<Eigen::Lower>().solveInPlace(out);
  rls.L.triangularView<Eigen::Lower>().transpose().solveInPlace(out);
  return out;
}

MatrixXd information_of_rows(const RecursiveLeastSquares& rls) {
  constexpr double kNothing = 1e-9;
  const MatrixXd all = rls.L * rls.L.transpose();
  MatrixXd out = all;
  out.diagonal().array() -= rls.prior;
  for (Index i = 0; i < out.rows(); ++i) {
    if (out(i, i) > kNothing * all(i, i)) continue;
    out.row(i).setZero();
    out.col(i).setZero();
  }
  return out;
}

VectorXd noise_variance(const RecursiveLeastSquares& rls) {
  const auto d = static_cast<double>(rls.theta.rows());
  const double freedom = rls.weight - d * rls.squared_weight / rls.weight;
  // n - d of exactly as many samples as coefficients is zero but for rounding.
  if (!(freedom > 1e-9 * rls.weight) || !determined(rls)) {
    return VectorXd::Constant(rls.theta.cols(), kNaN);
  }
  const VectorXd prior = rls.prior * rls.theta.colwise().squaredNorm().transpose();
  return (rls.squares - prior).cwiseMax(0.0) / freedom;
}

MatrixXd standard_errors(const RecursiveLeastSquares& rls) {
  const Index d = rls.theta.rows(), ny = rls.theta.cols();
  if (!determined(rls)) return MatrixXd::Constant(d, ny, kNaN);
  return inverse_correlation(rls).diagonal().cwiseSqrt() *
         noise_variance(rls).cwiseSqrt().transpose();
}

RegressionHistory run_recursive_least_squares(const Eigen::Ref<const MatrixXd>& phi,
                                              const Eigen::Ref<const VectorXd>& y, double delta,
                                              const Forgetting& forgetting) {
  constexpr double kLeastFactor = 0.1, kNoiseMemories = 10.0;
  const Index d = phi.rows(), n = phi.cols(), settle = 2 * d + 10;
  const bool variable = forgetting.memory > 0.0, test = forgetting.reset || forgetting.watch;
  if (y.size() != n) {
    throw std::invalid_argument("run_recursive_least_squares: as many rows as samples, please");
  }
  if (variable && !(forgetting.memory > 1.0)) {
    throw std::invalid_argument("run_recursive_least_squares: a memory of one sample or less");
  }
  RegressionHistory out;
  out.theta.resize(d, n);
  out.sd.resize(d, n);
  out.prior_error.resize(n);
  out.posterior_error.resize(n);
  out.standardised.resize(n);
  out.lambda.resize(n);
  out.log_alarm = VectorXd::Constant(n, kNaN);
  RecursiveLeastSquares rls = start_recursive_least_squares(d, 1, delta);
  ErrorGrowth growth = start_error_growth(forgetting.samples_per_false_alarm, settle);
  double noise = 0.0, known = 0.0;
  for (Index t = 0; t < n; ++t) {
    const double zeta = leverage(rls, phi.col(t));
    const double xi = y[t] - phi.col(t).dot(rls.theta.col(0));
    const double normalised = xi / std::sqrt(1.0 + zeta);
    out.standardised[t] = normalised / std::sqrt(noise_variance(rls)[0]);
    const bool predicted = std::isfinite(zeta);
    double lambda = variable ? 1.0 : forgetting.factor;
    if (variable && predicted && t >= settle) {
      if (noise > 0.0) {
        const double q = xi * xi / (forgetting.memory * noise), c = 1.0 - zeta - q;
        // Of c < 0 the other form: no difference of nearly equal numbers.
        const double root = std::sqrt(c * c + 4.0 * zeta);
        lambda = c > 0.0 ? 0.5 * (c + root) : 2.0 * zeta / (root - c);
        lambda = std::min(1.0, std::max(kLeastFactor, lambda));
      }
      known = std::min(known + 1.0, kNoiseMemories * forgetting.memory);
      noise += (normalised * normalised - noise) / known;
    }
    if (test && predicted) {
      const bool alarm = update(growth, normalised);
      out.log_alarm[t] = growth.log_alarm;
      if (alarm) {
        out.changes.push_back({std::max<Index>(0, t + 1 - growth.age), t});
        if (forgetting.reset) lambda = 1.0 / std::max(1.0, rls.weight);
      }
    }
    if (!update(rls, phi.col(t), y.segment(t, 1), lambda)) {
      throw std::invalid_argument("run_recursive_least_squares: an entry is not finite");
    }
    out.theta.col(t) = rls.theta.col(0);
    out.sd.col(t) = standard_errors(rls).col(0);
    out.prior_error[t] = xi;
    out.posterior_error[t] = rls.posterior_error[0];
    out.lambda[t] = lambda;
  }
  out.end = std::move(rls);
  return out;
}

double predictive_squares(const Eigen::Ref<const MatrixXd>& phi,
                          const Eigen::Ref<const VectorXd>& y, double delta, double lambda,
                          Index lead) {
  RecursiveLeastSquares rls = start_recursive_least_squares(phi.rows(), 1, delta);
  double sum = 0.0;
  for (Index t = 0; t < phi.cols(); ++t) {
    if (!update(rls, phi.col(t), y.segment(t, 1), lambda)) {
      throw std::invalid_argument("predictive_squares: an entry is not finite");
    }
    if (t >= lead) sum += rls.prior_error[0] * rls.prior_error[0];
  }
  return sum;
}

}  // namespace identikal
