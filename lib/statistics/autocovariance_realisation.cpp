#include "lib/statistics/autocovariance_realisation.h"

#include <stdexcept>

#include <Eigen/Cholesky>
#include <Eigen/QR>

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXd;

namespace {

// The smallest solution of the Riccati equation, from below; nothing when the steps do not settle
// or Sigma stops being a covariance.
std::optional<InnovationModel> spectral_factor(const MatrixXd& A, const MatrixXd& C,
                                               const MatrixXd& h, const MatrixXd& Y0) {
  constexpr int kSteps = 100000;
  constexpr double kSettled = 1e-13;
  MatrixXd P = MatrixXd::Zero(A.rows(), A.rows());
  for (int step = 0; step < kSteps; ++step) {
    const MatrixXd Sigma = Y0 - C * P * C.transpose();
    const Eigen::LLT<MatrixXd> factor(Sigma);
    if (factor.info() != Eigen::Success) return std::nullopt;
    const MatrixXd K = factor.solve((h - A * P * C.transpose()).transpose()).transpose();
    const MatrixXd next = A * P * A.transpose() + K * Sigma * K.transpose();
    const double change = (next - P).norm();
    if (!(change < 1e12 * (1.0 + Y0.norm()))) return std::nullopt;
    P = 0.5 * (next + next.transpose());
    if (change <= kSettled * P.norm()) return InnovationModel{K, Sigma};
  }
  return std::nullopt;
}

}  // namespace

AutocovarianceFit fit_autocovariances(const Eigen::Ref<const MatrixXd>& A,
                                      const Eigen::Ref<const MatrixXd>& C,
                                      const Autocovariances& Y) {
  const Index n = A.rows(), ny = C.rows(), M = static_cast<Index>(Y.size()) - 1;
  if (A.cols() != n || C.cols() != n || M < n || Y[0].rows() != ny || Y[0].cols() != ny) {
    throw std::invalid_argument("fit_autocovariances: shapes, or fewer lags than states");
  }
  MatrixXd modes(M * ny, n), seen(M * ny, ny);
  MatrixXd row = C;
  for (Index l = 0; l < M; ++l) {
    modes.middleRows(l * ny, ny) = row;
    seen.middleRows(l * ny, ny) = Y[l + 1];
    row = (row * A).eval();
  }
  AutocovarianceFit out;
  out.h = modes.colPivHouseholderQr().solve(seen);
  const MatrixXd fitted = modes * out.h;
  out.left = (seen - fitted).squaredNorm() / seen.squaredNorm();
  out.fitted.push_back(Y[0]);
  for (Index l = 0; l < M; ++l) out.fitted.emplace_back(fitted.middleRows(l * ny, ny));
  out.innovation = spectral_factor(A, C, out.h, 0.5 * (Y[0] + Y[0].transpose()));
  return out;
}

}  // namespace identikal
