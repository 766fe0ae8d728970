#include "lib/regression/lagged_regressors.h"

#include <algorithm>
#include <stdexcept>

#include "lib/base/constants.h"

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

LagWindow start_lag_window(Index channels, const RegressionOrder& order,
                           const RegressionOrder& reach) {
  if (channels < 1 || order.inputs < 1 || order.feedback < 0 || reach.inputs < order.inputs ||
      reach.feedback < order.feedback) {
    throw std::invalid_argument("start_lag_window: orders out of range");
  }
  LagWindow out;
  out.order = order;
  out.u = MatrixXd::Constant(channels, reach.inputs, kNaN);
  out.y = VectorXd::Constant(1 + reach.feedback, kNaN);
  out.phi = VectorXd::Zero(channels * order.inputs + order.feedback);
  return out;
}

LagWindow start_lag_window(Index channels, const RegressionOrder& order) {
  return start_lag_window(channels, order, order);
}

bool take(LagWindow& window, const Eigen::Ref<const VectorXd>& u, double y) {
  for (Index j = window.u.cols() - 1; j > 0; --j) window.u.col(j) = window.u.col(j - 1);
  for (Index j = window.y.size() - 1; j > 0; --j) window.y[j] = window.y[j - 1];
  window.u.col(0) = u;
  window.y[0] = y;
  if (!window.u.allFinite() || !window.y.allFinite()) return false;
  const Index m = window.u.rows(), inputs = window.order.inputs;
  for (Index i = 0; i < m; ++i) {
    window.phi.segment(i * inputs, inputs) = window.u.row(i).head(inputs).transpose();
  }
  window.phi.tail(window.order.feedback) = window.y.segment(1, window.order.feedback);
  return true;
}

LaggedRows lagged_rows(const Eigen::Ref<const MatrixXd>& u, const Eigen::Ref<const VectorXd>& y,
                       const RegressionOrder& order, const RegressionOrder& reach) {
  const Index N = y.size();
  if (u.cols() != N) {
    throw std::invalid_argument("lagged_rows: inputs and output of another length");
  }
  LagWindow window = start_lag_window(u.rows(), order, reach);
  const Index begin = std::max(reach.inputs - 1, reach.feedback);
  LaggedRows out;
  out.phi.resize(window.phi.size(), N);
  out.y.resize(N);
  for (Index t = 0; t < N; ++t) {
    if (take(window, u.col(t), y[t])) {
      const auto k = static_cast<Index>(out.sample.size());
      out.phi.col(k) = window.phi;
      out.y[k] = y[t];
      out.sample.push_back(t);
    } else if (t >= begin) {
      ++out.skipped;
    }
  }
  const auto n = static_cast<Index>(out.sample.size());
  out.phi.conservativeResize(Eigen::NoChange, n);
  out.y.conservativeResize(n);
  return out;
}

LaggedRows lagged_rows(const Eigen::Ref<const MatrixXd>& u, const Eigen::Ref<const VectorXd>& y,
                       const RegressionOrder& order) {
  return lagged_rows(u, y, order, order);
}

}  // namespace identikal
