#include "lib/whiteness.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace identikal {
namespace {

struct Centred {
  Eigen::VectorXd e;  // mean removed, 0 where missing
  Eigen::VectorXd present;
  double n = 0.0;
  double power = 0.0;  // sum of squares
};

Centred centre(const Eigen::Ref<const Eigen::VectorXd>& e) {
  Centred out;
  out.e = Eigen::VectorXd::Zero(e.size());
  out.present = Eigen::VectorXd::Zero(e.size());
  double sum = 0.0;
  for (Eigen::Index t = 0; t < e.size(); ++t) {
    if (std::isnan(e[t])) continue;
    out.present[t] = 1.0;
    sum += e[t];
    out.n += 1.0;
  }
  if (out.n == 0.0) return out;
  const double mean = sum / out.n;
  for (Eigen::Index t = 0; t < e.size(); ++t) {
    if (out.present[t] > 0.0) out.e[t] = e[t] - mean;
  }
  out.power = out.e.squaredNorm();
  // What rounding leaves of a constant sequence is not a signal.
  const double rounding = 1e-14 * std::abs(mean);
  if (out.power <= out.n * rounding * rounding) out.power = 0.0;
  return out;
}

}  // namespace

Eigen::VectorXd autocorrelation(const Eigen::Ref<const Eigen::VectorXd>& e, int lags,
                                Eigen::VectorXd* pairs) {
  const double none = std::numeric_limits<double>::quiet_NaN();
  const Centred c = centre(e);
  Eigen::VectorXd r = Eigen::VectorXd::Constant(lags, none);
  if (pairs != nullptr) *pairs = Eigen::VectorXd::Zero(lags);
  const Eigen::Index N = e.size();
  for (int k = 1; k <= lags && k < N; ++k) {
    const double n_k = c.present.head(N - k).dot(c.present.tail(N - k));
    if (pairs != nullptr) (*pairs)[k - 1] = n_k;
    if (n_k > 0.0 && c.power > 0.0) {
      r[k - 1] = (c.n / n_k) * c.e.head(N - k).dot(c.e.tail(N - k)) / c.power;
    }
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
  if (out.dof == 0.0) out.value = std::numeric_limits<double>::quiet_NaN();
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
