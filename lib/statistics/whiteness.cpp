#include "lib/statistics/whiteness.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "lib/base/constants.h"
#include "lib/statistics/autocovariance.h"

namespace identikal {
namespace {

// The mean removed; missing samples stay missing.
Eigen::VectorXd centred(const Eigen::Ref<const Eigen::VectorXd>& e) {
  const auto present = (e.array() == e.array());
  const auto n = static_cast<double>(present.count());
  const double mean = present.select(e.array(), 0.0).sum() / n;
  Eigen::VectorXd out = e.array() - mean;
  // What rounding leaves of a constant sequence is not a signal.
  const double rounding = 1e-14 * std::abs(mean);
  const double power = present.select(out.array(), 0.0).square().sum();
  if (power <= n * rounding * rounding) out = present.select(Eigen::VectorXd::Zero(e.size()), out);
  return out;
}

}  // namespace

Eigen::Index own_period(const Eigen::Ref<const Eigen::VectorXd>& e) {
  constexpr Eigen::Index kLongest = 100;
  const Eigen::Array<bool, Eigen::Dynamic, 1> present = e.array() == e.array();
  const Eigen::Index n = present.count();
  for (Eigen::Index k = 1; k <= std::min(kLongest, e.size() - 1); ++k) {
    const Eigen::Index rows = e.size() - k;
    if (4 * (present.head(rows) && present.tail(rows)).count() >= n) return k;
  }
  return 1;
}

Eigen::VectorXd autocorrelation(const Eigen::Ref<const Eigen::VectorXd>& e, int lags,
                                Eigen::VectorXd* pairs) {
  Eigen::VectorXd r = Eigen::VectorXd::Constant(lags, kNaN);
  if (pairs != nullptr) *pairs = Eigen::VectorXd::Zero(lags);
  const Eigen::VectorXd c = centred(e);
  const Eigen::Index period = own_period(e);
  const SampleAutocovariances Y = sample_autocovariances(c.transpose(), lags * period + 1);
  for (int k = 1; k <= lags; ++k) {
    const auto lag = static_cast<std::size_t>(k * period);
    if (pairs != nullptr) (*pairs)[k - 1] = Y.pairs[lag](0, 0);
    if (Y.value[0](0, 0) > 0.0) r[k - 1] = Y.value[lag](0, 0) / Y.value[0](0, 0);
  }
  return r;
}

ChiSquareStatistic ljung_box(const Eigen::Ref<const Eigen::VectorXd>& e, int lags) {
  Eigen::VectorXd pairs;
  const Eigen::VectorXd r = autocorrelation(e, lags, &pairs);
  const double n = (e.array() == e.array()).cast<double>().sum();
  // Var of the pairwise r_k is n_k^-1 (n/(n+2)) for a complete white Gaussian sequence, which is
  // Ljung and Box' weight n (n+2) / (n-k) rewritten for r_k with its own count of pairs.
  ChiSquareStatistic out;
  for (int k = 0; k < lags; ++k) {
    if (pairs[k] > 0.0 && !std::isnan(r[k])) {
      out.value += (n + 2.0) / n * pairs[k] * r[k] * r[k];
      out.dof += 1.0;
    }
  }
  if (out.dof == 0.0) out.value = kNaN;
  return out;
}

Eigen::VectorXd mehra_share(const Autocovariances& gamma, Eigen::Index samples, double quantile) {
  const double bound = quantile / std::sqrt(static_cast<double>(samples));
  Eigen::VectorXd inside = Eigen::VectorXd::Zero(gamma[0].rows());
  for (std::size_t k = 1; k < gamma.size(); ++k) {
    inside.array() += (gamma[k].diagonal().array().abs() < bound).cast<double>();
  }
  return inside / static_cast<double>(gamma.size() - 1);
}

Eigen::VectorXd published_chi_square(const Autocovariances& gamma, Eigen::Index samples) {
  Eigen::VectorXd out = Eigen::VectorXd::Zero(gamma[0].rows());
  for (std::size_t k = 1; k < gamma.size(); ++k) out += gamma[k].diagonal().cwiseAbs2();
  return static_cast<double>(samples) * out;
}

ChiSquareStatistic portmanteau(const Eigen::Ref<const Eigen::MatrixXd>& e, int lags) {
  ChiSquareStatistic out;
  out.value = kNaN;
  const SampleAutocovariances Y = sample_autocovariances(e, lags + 1);
  const auto ny = static_cast<double>(e.rows());
  const double all = Y.pairs[0].minCoeff();
  if (!(all >= ny + 2.0) || !Y.value[0].allFinite()) return out;
  const Eigen::LLT<Eigen::MatrixXd> llt(Y.value[0]);
  if (llt.info() != Eigen::Success) return out;
  // Rounding makes a copy of another channel look like one of its own.
  const Eigen::VectorXd left = llt.matrixLLT().diagonal().cwiseAbs2();
  if ((left.array() <= 1e-12 * Y.value[0].diagonal().array()).any()) return out;
  out.value = 0.0;
  const double weight =
      all * (all - 1.0) * (all + 2.0) * ny * ny / (ny * ny * (all + 1.0) - 2.0 * ny);
  for (int k = 1; k <= lags; ++k) {
    const auto lag = static_cast<std::size_t>(k);
    if (Y.pairs[lag].minCoeff() < 1.0) continue;
    const double pairs = Y.pairs[lag].mean();
    const Eigen::MatrixXd C_k =
        Y.value[lag].array() * (Y.pairs[lag].array() / pairs).sqrt() * (pairs / all);
    const Eigen::MatrixXd half = llt.matrixL().solve(C_k);
    out.value += weight / pairs * llt.matrixL().solve(half.transpose()).squaredNorm();
    out.dof += ny * ny;
  }
  if (out.dof == 0.0) out.value = kNaN;
  return out;
}

int default_lags(Eigen::Index samples) {
  return static_cast<int>(std::max<Eigen::Index>(1, std::min<Eigen::Index>(20, samples / 5)));
}

ChiSquareStatistic normalised_innovation_squared(
    const Eigen::Ref<const Eigen::MatrixXd>& standardised) {
  ChiSquareStatistic out;
  for (Eigen::Index t = 0; t < standardised.cols(); ++t) {
    for (Eigen::Index i = 0; i < standardised.rows(); ++i) {
      const double z = standardised(i, t);
      if (std::isnan(z)) continue;
      out.value += z * z;
      out.dof += 1.0;
    }
  }
  return out;
}

}  // namespace identikal
