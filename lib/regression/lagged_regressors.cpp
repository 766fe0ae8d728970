#include "lib/regression/lagged_regressors.h"

#include <algorithm>
#include <stdexcept>

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

LaggedRows lagged_rows(const Eigen::Ref<const MatrixXd>& u, const Eigen::Ref<const VectorXd>& y,
                       const RegressionOrder& order, const RegressionOrder& reach) {
  const Index m = u.rows(), N = y.size();
  if (u.cols() != N || m < 1 || order.inputs < 1 || order.feedback < 0 ||
      reach.inputs < order.inputs || reach.feedback < order.feedback) {
    throw std::invalid_argument("lagged_rows: shapes or orders out of range");
  }
  const Index begin = std::max(reach.inputs - 1, reach.feedback);
  LaggedRows out;
  std::vector<Index>& sample = out.sample;
  for (Index t = begin; t < N; ++t) {
    const bool complete = u.middleCols(t - reach.inputs + 1, reach.inputs).allFinite() &&
                          y.segment(t - reach.feedback, reach.feedback + 1).allFinite();
    if (complete) {
      sample.push_back(t);
    } else {
      ++out.skipped;
    }
  }
  const auto n = static_cast<Index>(sample.size());
  out.phi.resize(m * order.inputs + order.feedback, n);
  out.y.resize(n);
  for (Index k = 0; k < n; ++k) {
    const Index t = sample[k];
    out.y[k] = y[t];
    for (Index i = 0; i < m; ++i) {
      for (Index j = 0; j < order.inputs; ++j) out.phi(i * order.inputs + j, k) = u(i, t - j);
    }
    for (Index j = 0; j < order.feedback; ++j) out.phi(m * order.inputs + j, k) = y[t - 1 - j];
  }
  return out;
}

LaggedRows lagged_rows(const Eigen::Ref<const MatrixXd>& u, const Eigen::Ref<const VectorXd>& y,
                       const RegressionOrder& order) {
  return lagged_rows(u, y, order, order);
}

}  // namespace identikal
