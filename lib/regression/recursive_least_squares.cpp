#include "lib/regression/recursive_least_squares.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "lib/base/constants.h"

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

double noise_variance(const RecursiveLeastSquares& rls, Index output) {
  const auto d = static_cast<double>(rls.theta.rows());
  const double freedom = rls.weight - d * rls.squared_weight / rls.weight;
  // n - d of exactly as many samples as coefficients is zero but for rounding.
  if (!(freedom > 1e-9 * rls.weight) || !determined(rls)) return kNaN;
  const double prior = rls.prior * rls.theta.col(output).squaredNorm();
  return std::max(0.0, rls.squares[output] - prior) / freedom;
}

VectorXd noise_variance(const RecursiveLeastSquares& rls) {
  VectorXd out(rls.theta.cols());
  for (Index j = 0; j < out.size(); ++j) out[j] = noise_variance(rls, j);
  return out;
}

MatrixXd standard_errors(const RecursiveLeastSquares& rls) {
  const Index d = rls.theta.rows(), ny = rls.theta.cols();
  if (!determined(rls)) return MatrixXd::Constant(d, ny, kNaN);
  return inverse_correlation(rls).diagonal().cwiseSqrt() *
         noise_variance(rls).cwiseSqrt().transpose();
}

void find_standard_errors(RecursiveLeastSquares& rls, Index output, Eigen::Ref<VectorXd> out) {
  if (!determined(rls)) {
    out.setConstant(kNaN);
    return;
  }
  const double sd = std::sqrt(noise_variance(rls, output));
  for (Index i = 0; i < out.size(); ++i) {
    // P_ii = || L^-1 e_i ||^2
    rls.row.setZero();
    rls.row[i] = 1.0;
    rls.L.triangularView<Eigen::Lower>().solveInPlace(rls.row);
    out[i] = sd * rls.row.norm();
  }
}

OnlineLeastSquares start_online_least_squares(Index regressors, double delta,
                                              const Forgetting& forgetting) {
  if (forgetting.memory > 0.0 && !(forgetting.memory > 1.0)) {
    throw std::invalid_argument("start_online_least_squares: a memory of one sample or less");
  }
  OnlineLeastSquares out;
  out.rls = start_recursive_least_squares(regressors, 1, delta);
  out.forgetting = forgetting;
  out.settle = 2 * regressors + 10;
  out.growth = start_error_growth(forgetting.samples_per_false_alarm, out.settle);
  out.sd = VectorXd::Constant(regressors, kNaN);
  return out;
}

namespace {

// The variable lambda of an error, whose variance is then known a little better.
double variable_factor(OnlineLeastSquares& online, double zeta, double normalised) {
  constexpr double kLeastFactor = 0.1, kNoiseMemories = 10.0;
  const double memory = online.forgetting.memory;
  double lambda = 1.0;
  if (online.noise > 0.0) {
    const double xi = online.prior_error;
    const double q = xi * xi / (memory * online.noise), c = 1.0 - zeta - q;
    // Of c < 0 the other form: no difference of nearly equal numbers.
    const double root = std::sqrt(c * c + 4.0 * zeta);
    lambda = c > 0.0 ? 0.5 * (c + root) : 2.0 * zeta / (root - c);
    lambda = std::min(1.0, std::max(kLeastFactor, lambda));
  }
  online.known = std::min(online.known + 1.0, kNoiseMemories * memory);
  online.noise += (normalised * normalised - online.noise) / online.known;
  return lambda;
}

}  // namespace

bool step(OnlineLeastSquares& online, const Eigen::Ref<const VectorXd>& phi, double y) {
  if (!phi.allFinite() || !std::isfinite(y)) return false;
  const Forgetting& forgetting = online.forgetting;
  RecursiveLeastSquares& rls = online.rls;
  if (phi.size() != rls.theta.rows()) {
    throw std::invalid_argument("step: regressors of another size");
  }
  const Index t = rls.samples;
  const double zeta = leverage(rls, phi);
  online.prior_error = y - phi.dot(rls.theta.col(0));
  const double normalised = online.prior_error / std::sqrt(1.0 + zeta);
  online.standardised = normalised / std::sqrt(noise_variance(rls, 0));
  const bool predicted = std::isfinite(zeta);
  const bool variable = forgetting.memory > 0.0, test = forgetting.reset || forgetting.watch;
  double lambda = variable ? 1.0 : forgetting.factor;
  if (variable && predicted && t >= online.settle) {
    lambda = variable_factor(online, zeta, normalised);
  }
  online.log_alarm = kNaN;
  online.change.reset();
  if (test && predicted) {
    const bool alarm = update(online.growth, normalised);
    online.log_alarm = online.growth.log_alarm;
    if (alarm) {
      online.change = {std::max<Index>(0, t + 1 - online.growth.age), t};
      if (forgetting.reset) lambda = 1.0 / std::max(1.0, rls.weight);
    }
  }
  update(rls, phi, Eigen::Map<const VectorXd>(&y, 1), lambda);
  find_standard_errors(rls, 0, online.sd);
  online.posterior_error = rls.posterior_error[0];
  online.lambda = lambda;
  return true;
}

RegressionHistory run_recursive_least_squares(const Eigen::Ref<const MatrixXd>& phi,
                                              const Eigen::Ref<const VectorXd>& y, double delta,
                                              const Forgetting& forgetting) {
  const Index d = phi.rows(), n = phi.cols();
  if (y.size() != n) {
    throw std::invalid_argument("run_recursive_least_squares: as many rows as samples, please");
  }
  RegressionHistory out;
  out.theta.resize(d, n);
  out.sd.resize(d, n);
  out.prior_error.resize(n);
  out.posterior_error.resize(n);
  out.standardised.resize(n);
  out.lambda.resize(n);
  out.log_alarm.resize(n);
  OnlineLeastSquares online = start_online_least_squares(d, delta, forgetting);
  for (Index t = 0; t < n; ++t) {
    if (!step(online, phi.col(t), y[t])) {
      throw std::invalid_argument("run_recursive_least_squares: an entry is not finite");
    }
    out.theta.col(t) = online.rls.theta.col(0);
    out.sd.col(t) = online.sd;
    out.prior_error[t] = online.prior_error;
    out.posterior_error[t] = online.posterior_error;
    out.standardised[t] = online.standardised;
    out.lambda[t] = online.lambda;
    out.log_alarm[t] = online.log_alarm;
    if (online.change) out.changes.push_back(*online.change);
  }
  out.end = std::move(online.rls);
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
