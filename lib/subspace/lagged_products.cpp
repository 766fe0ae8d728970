#include "lib/subspace/lagged_products.h"

#include <algorithm>
#include <stdexcept>

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

constexpr Index kColumnsAtOnce =
    4096;  // columns that stay in the cache while all lags pass over them

// Adds the windows of one gapless segment, q x T with T > lags, and the states before its rows, n x T.
void add_segment(const Eigen::Ref<const MatrixXd>& z, const Eigen::Ref<const MatrixXd>& x,
                 LaggedProducts& sums) {
  const Index q = z.rows(), n = x.rows(), lags = sums.lags, last = z.cols(), at_x = (lags + 1) * q;
  MatrixXd G = MatrixXd::Zero(sums.gram.rows(), sums.gram.cols());
  for (Index from = lags; from < last; from += kColumnsAtOnce) {
    const Index count = std::min(kColumnsAtOnce, last - from);
    const auto oldest = x.middleCols(from - lags, count);
    for (Index k = 0; k <= lags; ++k) {
      const auto lagged = z.middleCols(from - k, count);
      G.block(0, k * q, q, q).noalias() += z.middleCols(from, count) * lagged.transpose();
      if (n > 0) G.block(k * q, at_x, q, n).noalias() += lagged * oldest.transpose();
    }
    if (n > 0) G.bottomRightCorner(n, n).noalias() += oldest * oldest.transpose();
  }
  // One row further back the sum has one product more at its begin and one less at its end.
  for (Index i = 0; i < lags; ++i) {
    for (Index j = i; j < lags; ++j) {
      G.block((i + 1) * q, (j + 1) * q, q, q) =
          G.block(i * q, j * q, q, q) + z.col(lags - 1 - i) * z.col(lags - 1 - j).transpose() -
          z.col(last - 1 - i) * z.col(last - 1 - j).transpose();
    }
  }
  sums.gram.triangularView<Eigen::Upper>() += G;
  sums.windows += last - lags;
}

void check(const std::vector<MatrixXd>& y, const std::vector<MatrixXd>& u,
           const std::vector<MatrixXd>& x, Index lags) {
  if (y.empty() || y.size() != u.size() || (!x.empty() && x.size() != y.size())) {
    throw std::invalid_argument("lagged_products: needs recordings, each with y and u");
  }
  for (std::size_t k = 0; k < y.size(); ++k) {
    const bool fits = y[k].rows() == y[0].rows() && u[k].rows() == u[0].rows() &&
                      y[k].cols() == u[k].cols() &&
                      (x.empty() || (x[k].rows() == x[0].rows() && x[k].cols() == y[k].cols()));
    if (!fits) {
      throw std::invalid_argument(
          "lagged_products: recordings differ in their channels, or y, u and x in their rows");
    }
  }
  if (lags < 1 || y[0].rows() < 1) {
    throw std::invalid_argument("lagged_products: needs an output and at least one lag");
  }
}

}  // namespace

LaggedProducts lagged_products(const std::vector<MatrixXd>& y, const std::vector<MatrixXd>& u,
                               Index lags, const std::vector<MatrixXd>& x) {
  check(y, u, x, lags);
  LaggedProducts sums{y[0].rows(), u[0].rows(), lags, x.empty() ? 0 : x[0].rows(), 0, {}};
  const Index q = sums.channels(), size = (lags + 1) * q + sums.states;
  sums.gram.setZero(size, size);
  for (std::size_t k = 0; k < y.size(); ++k) {
    MatrixXd z(q, y[k].cols());
    z << y[k], u[k];
    const MatrixXd none(0, z.cols());
    const MatrixXd& before = x.empty() ? none : x[k];
    Index begin = 0;
    for (Index t = 0; t <= z.cols(); ++t) {
      if (t < z.cols() && z.col(t).allFinite()) continue;
      const Index count = t - begin;
      if (count > lags)
        add_segment(z.middleCols(begin, count), before.middleCols(begin, count), sums);
      begin = t + 1;
    }
  }
  sums.gram.triangularView<Eigen::StrictlyLower>() = sums.gram.transpose();
  return sums;
}

}  // namespace identikal
