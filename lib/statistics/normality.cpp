#include "lib/statistics/normality.h"

#include <cmath>

#include <Eigen/Cholesky>

#include "lib/base/constants.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

}  // namespace

Moments moments(const Eigen::Ref<const VectorXd>& e) {
  Moments out;
  const auto present = (e.array() == e.array());
  out.samples = static_cast<double>(present.count());
  out.mean = present.select(e.array(), 0.0).sum() / out.samples;
  const VectorXd c = present.select(e.array() - out.mean, 0.0);
  out.variance = c.squaredNorm() / out.samples;
  out.skewness = out.kurtosis = kNaN;
  // What rounding leaves of a constant sequence is not a signal.
  if (!(out.variance > 1e-28 * out.mean * out.mean)) return out;
  const VectorXd z = c / std::sqrt(out.variance), squares = z.cwiseAbs2();
  out.skewness = squares.dot(z) / out.samples;
  out.kurtosis = squares.squaredNorm() / out.samples;
  return out;
}

ChiSquareStatistic doornik_hansen(const Moments& m) {
  const double n = m.samples;
  if (!(n >= 8.0) || std::isnan(m.skewness)) return {kNaN, 2.0};
  // D'Agostino's (1970) transform of the skewness.
  const double beta = 3.0 * (n * n + 27.0 * n - 70.0) * (n + 1.0) * (n + 3.0) /
                      ((n - 2.0) * (n + 5.0) * (n + 7.0) * (n + 9.0));
  const double omega2 = -1.0 + std::sqrt(2.0 * (beta - 1.0));
  const double y =
      m.skewness * std::sqrt(0.5 * (omega2 - 1.0) * (n + 1.0) * (n + 3.0) / (6.0 * (n - 2.0)));
  const double z1 = std::asinh(y) / std::sqrt(0.5 * std::log(omega2));
  // The kurtosis as a gamma variable that depends on the skewness, by Wilson and Hilferty's root.
  const double delta = (n - 3.0) * (n + 1.0) * (n * n + 15.0 * n - 4.0);
  const double a = (n - 2.0) * (n + 5.0) * (n + 7.0) * (n * n + 27.0 * n - 70.0) / (6.0 * delta);
  const double c = (n - 7.0) * (n + 5.0) * (n + 7.0) * (n * n + 2.0 * n - 5.0) / (6.0 * delta);
  const double k =
      (n + 5.0) * (n + 7.0) * (n * n * n + 37.0 * n * n + 11.0 * n - 313.0) / (12.0 * delta);
  const double b1 = m.skewness * m.skewness, alpha = a + b1 * c;
  const double chi = 2.0 * k * (m.kurtosis - 1.0 - b1);
  const double z2 =
      std::sqrt(9.0 * alpha) * (1.0 / (9.0 * alpha) - 1.0 + std::cbrt(chi / (2.0 * alpha)));
  return {z1 * z1 + z2 * z2, 2.0};
}

ChiSquareStatistic mcleod_li(const Eigen::Ref<const VectorXd>& e, int lags) {
  return ljung_box(e.cwiseAbs2(), lags);
}

FStatistic mean_test(const Eigen::Ref<const MatrixXd>& e) {
  FStatistic out;
  const auto ny = static_cast<double>(e.rows());
  double n = 0.0;
  VectorXd sum = VectorXd::Zero(e.rows());
  MatrixXd products = MatrixXd::Zero(e.rows(), e.rows());
  for (Index t = 0; t < e.cols(); ++t) {
    if (!e.col(t).allFinite()) continue;
    n += 1.0;
    sum += e.col(t);
    products.selfadjointView<Eigen::Lower>().rankUpdate(e.col(t));
  }
  out.value = kNaN;
  if (n <= ny) return out;
  products.selfadjointView<Eigen::Lower>().rankUpdate(sum, -1.0 / n);
  const Eigen::LLT<MatrixXd> llt(products);
  if (llt.info() != Eigen::Success) return out;
  const VectorXd half = llt.matrixL().solve(sum);
  // T^2 = (n - 1) |half|^2 / n; F = (n - ny) / ((n - 1) ny) T^2.
  out.value = half.squaredNorm() / n * (n - ny) / ny;
  out.dof = ny;
  out.dof_rest = n - ny;
  return out;
}

}  // namespace identikal
