#include "lib/subspace/lagged_products.h"

#include <algorithm>
#include <stdexcept>

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

constexpr Index kChunk = 4096;  // columns that stay in the cache while all lags pass over them

// Adds the windows of one gapless stretch, q x T with T > lags.
void add_stretch(const Eigen::Ref<const MatrixXd>& z, LaggedProducts& sums) {
  const Index q = z.rows(), lags = sums.lags, last = z.cols();
  MatrixXd G = MatrixXd::Zero(sums.gram.rows(), sums.gram.cols());
  for (Index from = lags; from < last; from += kChunk) {
    const Index count = std::min(kChunk, last - from);
    for (Index k = 0; k <= lags; ++k) {
      G.block(0, k * q, q, q).noalias() +=
          z.middleCols(from, count) * z.middleCols(from - k, count).transpose();
    }
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

void check(const std::vector<MatrixXd>& y, const std::vector<MatrixXd>& u, Index lags) {
  if (y.empty() || y.size() != u.size()) {
    throw std::invalid_argument("lagged_products: needs recordings, each with y and u");
  }
  for (std::size_t k = 0; k < y.size(); ++k) {
    if (y[k].rows() != y[0].rows() || u[k].rows() != u[0].rows() || y[k].cols() != u[k].cols()) {
      throw std::invalid_argument(
          "lagged_products: recordings differ in their channels, or y and u in their rows");
    }
  }
  if (lags < 1 || y[0].rows() < 1) {
    throw std::invalid_argument("lagged_products: needs an output and at least one lag");
  }
}

}  // namespace

LaggedProducts lagged_products(const std::vector<MatrixXd>& y, const std::vector<MatrixXd>& u,
                               Index lags) {
  check(y, u, lags);
  LaggedProducts sums{y[0].rows(), u[0].rows(), lags, 0, {}};
  const Index q = sums.channels(), size = (lags + 1) * q;
  sums.gram.setZero(size, size);
  for (std::size_t k = 0; k < y.size(); ++k) {
    MatrixXd z(q, y[k].cols());
    z << y[k], u[k];
    Index begin = 0;
    for (Index t = 0; t <= z.cols(); ++t) {
      if (t < z.cols() && z.col(t).allFinite()) continue;
      if (t - begin > lags) add_stretch(z.middleCols(begin, t - begin), sums);
      begin = t + 1;
    }
  }
  sums.gram.triangularView<Eigen::StrictlyLower>() = sums.gram.transpose();
  return sums;
}

}  // namespace identikal
