#include "lib/statistics/autocorrelation.h"

#include <stdexcept>

#include "lib/base/constants.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

// The first N - M products of every lag. There are few lags where this makes sense (N >> M).
Autocovariances truncated(const Eigen::Ref<const MatrixXd>& e, Index lags) {
  const Index count = e.cols() - lags + 1;
  if (lags < 1 || count < 1) {
    throw std::invalid_argument("autocovariances: as many lags as samples, or none");
  }
  const MatrixXd present = (e.array() == e.array()).cast<double>();
  const MatrixXd values = (e.array() == e.array()).select(e, 0.0);
  Autocovariances out;
  for (Index k = 0; k < lags; ++k) {
    const MatrixXd pairs = present.middleCols(k, count) * present.leftCols(count).transpose();
    out.emplace_back(
        (values.middleCols(k, count) * values.leftCols(count).transpose()).cwiseQuotient(pairs));
  }
  return out;
}

}  // namespace

Autocovariances sample_autocovariances(const Eigen::Ref<const MatrixXd>& e, Index lags,
                                       Divisor divisor) {
  if (divisor == Divisor::truncated) return truncated(e, lags);
  SampleAutocovariances sample = sample_autocovariances(e, lags);
  const MatrixXd all = sample.pairs[0];
  for (std::size_t k = 0; k < sample.value.size(); ++k) {
    const MatrixXd share = sample.pairs[k].cwiseQuotient(all);
    if (divisor == Divisor::samples) sample.value[k].array() *= share.array();
    if (divisor == Divisor::equal_variance) sample.value[k].array() *= share.array().sqrt();
  }
  return sample.value;
}

Autocovariances autocorrelations(const Autocovariances& Y) {
  Autocovariances out = Y;
  if (Y.empty()) return out;
  const Eigen::VectorXd variance = Y[0].diagonal();
  const Eigen::VectorXd scale =
      (variance.array() > 0.0).select(variance.cwiseSqrt().cwiseInverse(), kNaN);
  for (MatrixXd& gamma : out) gamma = (scale.asDiagonal() * gamma * scale.asDiagonal()).eval();
  return out;
}

}  // namespace identikal
