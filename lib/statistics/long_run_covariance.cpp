#include "lib/statistics/long_run_covariance.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

namespace identikal {

Eigen::MatrixXd long_run_covariance(const Eigen::Ref<const Eigen::MatrixXd>& terms,
                                    Eigen::Index bandwidth) {
  if (bandwidth < 1) {
    throw std::invalid_argument("long_run_covariance: bandwidth " + std::to_string(bandwidth));
  }
  // The Bartlett sum equals the squares of the sums over all windows of that length that touch the
  // record, divided by the length: linear in N, whatever the bandwidth.
  const Eigen::Index k = terms.rows(), N = terms.cols();
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(k, k);
  Eigen::VectorXd window = Eigen::VectorXd::Zero(k);
  for (Eigen::Index end = 0; end < N + bandwidth - 1; ++end) {
    if (end < N) window += terms.col(end);
    if (end >= bandwidth) window -= terms.col(end - bandwidth);
    out.selfadjointView<Eigen::Lower>().rankUpdate(window);
  }
  out.triangularView<Eigen::StrictlyUpper>() = out.transpose();
  return out / static_cast<double>(bandwidth);
}

Eigen::Index andrews_bandwidth(const Eigen::Ref<const Eigen::MatrixXd>& terms,
                               Eigen::Index largest) {
  const Eigen::Index N = terms.cols();
  double numerator = 0.0, denominator = 0.0;
  for (Eigen::Index i = 0; N > 1 && i < terms.rows(); ++i) {
    const auto x = terms.row(i);
    const double power = x.head(N - 1).squaredNorm();
    if (!(power > 0.0)) continue;
    // Close to 1 the formula explodes; there `largest` decides anyway.
    const double rho = std::clamp(x.head(N - 1).dot(x.tail(N - 1)) / power, -0.999, 0.999);
    // The innovation variance of a row with unit variance is 1 - rho^2.
    const double s4 = std::pow(1.0 - rho * rho, 2);
    numerator += 4.0 * rho * rho * s4 / (std::pow(1.0 - rho, 6) * std::pow(1.0 + rho, 2));
    denominator += s4 / std::pow(1.0 - rho, 4);
  }
  if (!(denominator > 0.0)) return 1;
  const double bandwidth = 1.1447 * std::cbrt(numerator / denominator * static_cast<double>(N));
  const double limited = std::min(bandwidth, static_cast<double>(largest));
  return std::max<Eigen::Index>(1, static_cast<Eigen::Index>(std::ceil(limited)));
}

Eigen::MatrixXd widest_long_run_covariance(const Eigen::Ref<const Eigen::MatrixXd>& terms,
                                           const Eigen::Ref<const Eigen::MatrixXd>& white,
                                           Eigen::Index& bandwidth) {
  const Eigen::Index largest = std::max<Eigen::Index>(1, terms.cols() / 8);
  Eigen::MatrixXd widest;
  double most = -1.0;
  for (Eigen::Index tried = andrews_bandwidth(terms, largest); tried <= largest; tried *= 2) {
    const Eigen::MatrixXd candidate = long_run_covariance(terms, tried);
    double inflation = 0.0;
    for (Eigen::Index i = 0; i < white.rows(); ++i) {
      if (white(i, i) > 0.0) inflation += candidate(i, i) / white(i, i);
    }
    if (inflation <= most) continue;
    most = inflation;
    widest = candidate;
    bandwidth = tried;
  }
  return widest;
}

}  // namespace identikal
