#include "lib/statistics/input_correlation.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <Eigen/Eigenvalues>

#include "lib/base/constants.h"
#include "lib/base/message.h"
#include "lib/statistics/normality.h"

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

FStatistic input_correlation(const Eigen::Ref<const VectorXd>& e,
                             const Eigen::Ref<const MatrixXd>& u, int lags) {
  if (u.cols() != e.size() || lags < 0) {
    throw std::invalid_argument(message({"input_correlation: ", e.size(), " innovations, inputs ",
                                         u.rows(), " x ", u.cols(), ", ", lags, " lags"}));
  }
  FStatistic out;
  out.value = kNaN;
  const Index nu = u.rows(), size = nu * (lags + 1), N = e.size();
  // In units of their own size, so that the rank does not depend on the user's.
  MatrixXd inputs(nu, N);
  for (Index j = 0; j < nu; ++j) {
    const Moments m = moments(u.row(j).transpose());
    const bool constant = std::isnan(m.skewness);
    inputs.row(j) = (u.row(j).array() - m.mean) * (constant ? 0.0 : 1.0 / std::sqrt(m.variance));
  }
  // Products over a few thousand rows at a time. One column of the inputs holds all channels of a
  // time, so that a row of regressors is one segment of it, oldest first.
  constexpr Index kRows = 2048;
  MatrixXd rows(size, kRows), G = MatrixXd::Zero(size, size);
  VectorXd values(kRows), c = VectorXd::Zero(size);
  double squares = 0.0, samples = 0.0;
  Index filled = 0;
  const auto take = [&] {
    G.selfadjointView<Eigen::Lower>().rankUpdate(rows.leftCols(filled));
    c.noalias() += rows.leftCols(filled) * values.head(filled);
    squares += values.head(filled).squaredNorm();
    samples += static_cast<double>(filled);
    filled = 0;
  };
  for (Index t = lags; t < N; ++t) {
    const Eigen::Map<const VectorXd> row(inputs.data() + nu * (t - lags), size);
    if (!std::isfinite(e[t]) || !row.allFinite()) continue;
    rows.col(filled) = row;
    values[filled++] = e[t];
    if (filled == kRows) take();
  }
  take();
  if (!(squares > 0.0)) return out;
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(G);
  const double least = 1e-9 * std::max(samples, eigen.eigenvalues().maxCoeff());
  double explained = 0.0;
  for (Index i = 0; i < size; ++i) {
    if (!(eigen.eigenvalues()[i] > least)) continue;
    explained += std::pow(eigen.eigenvectors().col(i).dot(c), 2) / eigen.eigenvalues()[i];
    out.dof += 1.0;
  }
  out.dof_rest = samples - out.dof;
  if (out.dof > 0.0 && out.dof_rest > 0.0) {
    out.value = explained / out.dof / (std::max(0.0, squares - explained) / out.dof_rest);
  }
  return out;
}

}  // namespace identikal
