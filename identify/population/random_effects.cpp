#include "identify/population/random_effects.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>

#include <Eigen/Cholesky>
#include <Eigen/QR>

#include "identify/estimate/distribution.h"
#include "lib/base/constants.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// From so many units on one of them changes what the others make expect by less than its rounding.
constexpr Index kMany = 500;

double log_determinant(const Eigen::LLT<MatrixXd>& factor) {
  return 2.0 * factor.matrixLLT().diagonal().array().log().sum();
}

/// Weighted least squares with weights 1 / (v + t).
struct Weighted {
  VectorXd w, residual, beta;
  MatrixXd covariance;   // of beta, where v + t are the variances
  double log_det = 0.0;  // of X' W X

  Weighted(const VectorXd& y, const VectorXd& v, const MatrixXd& X, double t)
      : w((v.array() + t).inverse()) {
    const Eigen::LLT<MatrixXd> normal(X.transpose() * w.asDiagonal() * X);
    log_det = log_determinant(normal);
    covariance = normal.solve(MatrixXd::Identity(X.cols(), X.cols()));
    beta = normal.solve(X.transpose() * w.cwiseProduct(y));
    residual = y - X * beta;
  }
  double q() const { return w.dot(residual.cwiseAbs2()); }
};

double restricted_log_likelihood(const Weighted& at, const MatrixXd& X) {
  const auto n = static_cast<double>(X.rows() - X.cols());
  const double of_design = log_determinant(Eigen::LLT<MatrixXd>(X.transpose() * X));
  return -0.5 * (n * kLogTwoPi - at.w.array().log().sum() + at.log_det - of_design + at.q());
}

/// Derivative of the restricted log-likelihood by t = sd^2, and its expected information.
struct ScoreOfEffects {
  double gradient, information;
};

ScoreOfEffects score_of(const Weighted& at, const MatrixXd& X) {
  const VectorXd w2 = at.w.cwiseAbs2(), w3 = w2.cwiseProduct(at.w);
  const MatrixXd M2 = at.covariance * (X.transpose() * w2.asDiagonal() * X);
  const MatrixXd M3 = at.covariance * (X.transpose() * w3.asDiagonal() * X);
  const double trace_P = at.w.sum() - M2.trace();
  const double trace_PP = w2.sum() - 2.0 * M3.trace() + (M2 * M2).trace();
  return {-0.5 * (trace_P - w2.dot(at.residual.cwiseAbs2())), 0.5 * trace_PP};
}

// The variance between units at the maximum, not below zero.
double restricted_maximum(const VectorXd& y, const VectorXd& v, const MatrixXd& X) {
  // Started above: from there scoring comes down without stopping short at zero.
  const double spread = (y.array() - y.mean()).square().mean();
  double t = spread;
  double value = restricted_log_likelihood(Weighted(y, v, X, t), X);
  for (int iteration = 0; iteration < 200; ++iteration) {
    const ScoreOfEffects score = score_of(Weighted(y, v, X, t), X);
    double step = score.gradient / score.information;
    double next = t, next_value = value;
    for (int halving = 0; halving < 40; ++halving, step *= 0.5) {
      next = std::max(0.0, t + step);
      next_value = restricted_log_likelihood(Weighted(y, v, X, next), X);
      if (next_value >= value) break;
    }
    const double moved = std::abs(next - t);
    if (!(next_value >= value)) break;
    t = next;
    value = next_value;
    if (moved <= 1e-12 * (t + v.minCoeff())) break;
  }
  return t;
}

// The t >= 0 for which q(t), which falls, is this; 0 where it is smaller already.
double where_q_is(double q, const VectorXd& y, const VectorXd& v, const MatrixXd& X) {
  const auto q_at = [&](double t) { return Weighted(y, v, X, t).q(); };
  if (q_at(0.0) <= q) return 0.0;
  double low = 0.0, high = std::max(v.maxCoeff(), (y.array() - y.mean()).square().mean());
  while (q_at(high) > q) high *= 2.0;
  for (int i = 0; i < 200 && high - low > 1e-13 * high; ++i) {
    const double middle = 0.5 * (low + high);
    (q_at(middle) > q ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

void check(const VectorXd& y, const VectorXd& v, const MatrixXd& X,
           const RandomEffectsOptions& options) {
  const Index n = y.size(), p = X.cols();
  if (v.size() != n || X.rows() != n || p < 1) {
    throw std::invalid_argument("random effects: y, v and X differ in length");
  }
  if (n < p + 2) throw std::invalid_argument("random effects: fewer units than unknowns and two");
  if (!y.allFinite() || !X.allFinite() || !v.allFinite() || !(v.minCoeff() > 0.0)) {
    throw std::invalid_argument("random effects: estimates that are not finite, or without error");
  }
  if (Eigen::ColPivHouseholderQR<MatrixXd>(X).rank() < p) {
    throw std::invalid_argument("random effects: covariates that depend on each other");
  }
  if (!(options.level > 0.0 && options.level < 1.0)) {
    throw std::invalid_argument("random effects: a level outside 0 to 1");
  }
}

void take_mean(const Weighted& at, double level, RandomEffects& out) {
  out.beta = at.beta;
  const double scale = at.q() / out.freedom;  // Hartung and Knapp's
  out.se = (scale * at.covariance.diagonal()).cwiseSqrt();
  const double quantile = student_t_quantile(0.5 + 0.5 * level, out.freedom);
  out.p_value.resize(out.beta.size());
  for (Index i = 0; i < out.beta.size(); ++i) {
    const double half = quantile * out.se[i];
    out.interval.push_back({out.beta[i] - half, out.beta[i] + half});
    const double t = out.beta[i] / out.se[i];
    out.p_value[i] = f_upper_tail(t * t, 1.0, out.freedom);
  }
}

VectorXd without(const VectorXd& of, Index i) {
  VectorXd out(of.size() - 1);
  out << of.head(i), of.tail(of.size() - i - 1);
  return out;
}

MatrixXd without_row(const MatrixXd& of, Index i) {
  MatrixXd out(of.rows() - 1, of.cols());
  out << of.topRows(i), of.bottomRows(of.rows() - i - 1);
  return out;
}

// Of unit i from what the others make expect, in standard deviations of that.
double distance_of(Index i, const VectorXd& y, const VectorXd& v, const MatrixXd& X, double t) {
  const Index n = y.size();
  double between = t;
  VectorXd beta;
  MatrixXd covariance;
  if (n < kMany && n > X.cols() + 2) {
    const VectorXd others = without(y, i), errors = without(v, i);
    const MatrixXd design = without_row(X, i);
    if (Eigen::ColPivHouseholderQR<MatrixXd>(design).rank() < X.cols()) return 0.0;
    between = restricted_maximum(others, errors, design);
    const Weighted fit(others, errors, design, between);
    beta = fit.beta;
    covariance = fit.covariance;
  } else {
    const Weighted fit(y, v, X, between);
    beta = fit.beta;
    covariance = fit.covariance;
  }
  const Eigen::RowVectorXd x = X.row(i);
  const double variance = v[i] + between + (x * covariance * x.transpose()).value();
  return (y[i] - x.dot(beta)) / std::sqrt(variance);
}

// Benjamini and Hochberg: the largest k for which the k-th smallest p is at most k / n of the rate.
std::vector<bool> those_that_belong(const VectorXd& distance, double freedom, double rate) {
  const Index n = distance.size();
  std::vector<double> p(static_cast<std::size_t>(n));
  for (Index i = 0; i < n; ++i) {
    const double z = distance[i];
    p[static_cast<std::size_t>(i)] =
        n < kMany ? f_upper_tail(z * z, 1.0, std::max(1.0, freedom - 1.0)) : normal_two_sided(z);
  }
  std::vector<double> sorted = p;
  std::sort(sorted.begin(), sorted.end());
  double limit = 0.0;
  for (std::size_t k = 1; k <= sorted.size(); ++k) {
    const double allowed = rate * static_cast<double>(k) / static_cast<double>(n);
    if (sorted[k - 1] <= allowed) limit = allowed;
  }
  std::vector<bool> out;
  for (const double each : p) out.push_back(!(each <= limit));
  return out;
}

}  // namespace

RandomEffects random_effects(const Eigen::Ref<const VectorXd>& y_given,
                             const Eigen::Ref<const VectorXd>& v_given,
                             const Eigen::Ref<const MatrixXd>& X_given,
                             const RandomEffectsOptions& options) {
  const VectorXd y = y_given, v = v_given;
  const MatrixXd X = X_given;
  check(y, v, X, options);
  RandomEffects out;
  out.freedom = static_cast<double>(X.rows() - X.cols());
  const double t = restricted_maximum(y, v, X);
  const Weighted at(y, v, X, t);
  out.sd = std::sqrt(t);
  out.log_likelihood = restricted_log_likelihood(at, X);
  take_mean(at, options.level, out);
  const double tail = 0.5 - 0.5 * options.level;
  out.sd_interval = {std::sqrt(where_q_is(chi_square_quantile(1.0 - tail, out.freedom), y, v, X)),
                     std::sqrt(where_q_is(chi_square_quantile(tail, out.freedom), y, v, X))};
  out.q = Weighted(y, v, X, 0.0).q();
  out.q_p_value = chi_square_upper_tail(out.q, out.freedom);
  // Best linear unbiased prediction, with the error of beta in it.
  const VectorXd share = t * at.w;
  out.shrunken = X * at.beta + share.cwiseProduct(at.residual);
  out.shrunken_se.resize(y.size());
  out.distance.resize(y.size());
  for (Index i = 0; i < y.size(); ++i) {
    const double of_mean = (X.row(i) * at.covariance * X.row(i).transpose()).value();
    const double rest = 1.0 - share[i];
    out.shrunken_se[i] = std::sqrt(rest * t + rest * rest * of_mean);
    out.distance[i] = distance_of(i, y, v, X, t);
  }
  out.belongs = those_that_belong(out.distance, out.freedom, options.false_discoveries);
  return out;
}

CombinedUnits combine_units(const Eigen::Ref<const VectorXd>& y,
                            const Eigen::Ref<const VectorXd>& v, const std::vector<int>& unit,
                            int units) {
  const auto n = static_cast<std::size_t>(y.size());
  if (unit.size() != n || v.size() != y.size()) {
    throw std::invalid_argument("combine units: y, v and units differ in length");
  }
  VectorXd w = VectorXd::Zero(units), w2 = w, wy = w, count = w;
  const auto sum = [&](double t) {
    for (VectorXd* each : {&w, &w2, &wy, &count}) each->setZero();
    for (std::size_t i = 0; i < n; ++i) {
      const auto at = static_cast<Index>(i);
      const double weight = 1.0 / (v[at] + t);
      w[unit[i]] += weight;
      w2[unit[i]] += weight * weight;
      wy[unit[i]] += weight * y[at];
      count[unit[i]] += 1.0;
    }
  };
  sum(0.0);
  double excess = 0.0, scale = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    const auto at = static_cast<Index>(i);
    const double residual = y[at] - wy[unit[i]] / w[unit[i]];
    excess += residual * residual / v[at];
  }
  for (Index u = 0; u < units; ++u) {
    excess -= count[u] - 1.0;
    scale += w[u] - w2[u] / w[u];
  }
  const double within = scale > 1e-9 * w.sum() ? std::max(0.0, excess / scale) : 0.0;
  sum(within);
  return {wy.cwiseQuotient(w), w.cwiseInverse(), std::sqrt(within)};
}

}  // namespace identikal
