#include "lib/subspace/predictor.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Of `count` lags: cov = U diag(w) U' with ones in the upper triangle of U, so that w_j is what the response
// loses of its variance from j to j + 1.
void put_weights(double size, double decay, Eigen::Ref<VectorXd> w) {
  double now = size * decay;
  for (Index j = 0; j < w.size(); ++j) {
    const double next = j + 1 < w.size() ? now * decay : 0.0;
    w[j] = now - next;
    now = next;
  }
}

// Sums over rising numbers of lags, of every channel's rows.
void cumulate(Index channels, Index first, Index count, MatrixXd& rows) {
  for (Index c = 0; c < channels; ++c) {
    for (Index k = 1; k < count; ++k) {
      rows.row(first + c * count + k) += rows.row(first + c * count + k - 1);
    }
  }
}

// And from the last lag back.
void from_the_far_end(Index channels, Index first, Index count, MatrixXd& rows) {
  for (Index c = 0; c < channels; ++c) {
    for (Index k = count - 2; k >= 0; --k) {
      rows.row(first + c * count + k) += rows.row(first + c * count + k + 1);
    }
  }
}

}  // namespace

struct PredictorRegression::Posterior {
  Eigen::LLT<MatrixXd> factor;  // of I + D S D
  MatrixXd b;                   // L^-1 D F
  VectorXd scale;               // the diagonal of D
  VectorXd variance;            // of the noise, p
};

// place(row of the regression, channel, lag), channel by channel with rising lags.
template <typename Place>
void PredictorRegression::for_each_coefficient(const Place& place) const {
  Index row = 0;
  for (Index c = 0; c < p_ + m_; ++c) {
    for (Index lag = c < p_ ? 1 : 0; lag <= lags_; ++lag) place(row++, c, lag);
  }
}

// Regressors channel by channel: outputs at lags 1 to L, then inputs at lags 0 to L.
PredictorRegression::PredictorRegression(const LaggedProducts& sums)
    : p_(sums.outputs), m_(sums.inputs), lags_(sums.lags), windows_(sums.windows) {
  const Index q = p_ + m_, size = p_ * lags_ + m_ * (lags_ + 1);
  Eigen::VectorXi order(size);
  for_each_coefficient(
      [&](Index row, Index c, Index lag) { order[row] = static_cast<int>(lag * q + c); });
  S_ = sums.gram(order, order);
  F_ = sums.gram(order, Eigen::seqN(0, p_));
  YY_ = sums.gram.topLeftCorner(p_, p_);
  const auto cumulate_rows = [&](MatrixXd& rows) {
    cumulate(p_, 0, lags_, rows);
    cumulate(m_, p_ * lags_, lags_ + 1, rows);
  };
  cumulate_rows(S_);
  S_.transposeInPlace();
  cumulate_rows(S_);
  cumulate_rows(F_);
}

VectorXd PredictorRegression::weights(const PredictorPrior& prior) const {
  VectorXd w(S_.rows());
  for (Index c = 0; c < p_; ++c) {
    put_weights(prior.output_size, prior.output_decay, w.segment(c * lags_, lags_));
  }
  for (Index c = 0; c < m_; ++c) {
    put_weights(prior.input_size, prior.input_decay,
                w.segment(p_ * lags_ + c * (lags_ + 1), lags_ + 1));
  }
  return w;
}

PredictorRegression::Posterior PredictorRegression::posterior(const PredictorPrior& prior) const {
  Posterior out;
  out.scale = weights(prior).cwiseSqrt();
  MatrixXd M = out.scale.asDiagonal() * S_ * out.scale.asDiagonal();
  M.diagonal().array() += 1.0;
  out.factor.compute(M);
  out.b = out.factor.matrixL().solve(out.scale.asDiagonal() * F_);
  // What is left of an output that is predicted exactly is rounding.
  const VectorXd left = YY_.diagonal() - out.b.colwise().squaredNorm().transpose();
  out.variance =
      left.cwiseMax(1e-14 * YY_.diagonal()).cwiseMax(1e-300) / static_cast<double>(windows_);
  return out;
}

double PredictorRegression::log_evidence(const PredictorPrior& prior) const {
  const Posterior at = posterior(prior);
  const MatrixXd& L = at.factor.matrixLLT();
  return -0.5 * static_cast<double>(windows_) * at.variance.array().log().sum() -
         static_cast<double>(p_) * L.diagonal().array().log().sum();
}

Predictor PredictorRegression::estimate(const PredictorPrior& prior) const {
  const Posterior at = posterior(prior);
  // Back from sums over lags to the lags: every response is a sum from its far end.
  MatrixXd f = at.scale.asDiagonal() * at.factor.matrixU().solve(at.b);
  from_the_far_end(p_, 0, lags_, f);
  from_the_far_end(m_, p_ * lags_, lags_ + 1, f);
  const Index q = p_ + m_;
  Predictor out;
  out.H.setZero(p_, lags_ * q);
  out.D.setZero(p_, m_);
  for_each_coefficient([&](Index row, Index c, Index lag) {
    (lag == 0 ? out.D.col(c - p_) : out.H.col((lag - 1) * q + c)) = f.row(row).transpose();
  });
  // The same number for every pair of outputs: sum (y_i - f_i' z)(y_j - f_j' z) over the windows.
  const MatrixXd both = at.b.transpose() * at.b;
  const MatrixXd g = at.factor.matrixU().solve(at.b);
  out.sigma = (YY_ - both - g.transpose() * g) / static_cast<double>(windows_);
  for (Index i = 0; i < p_; ++i) {
    out.sigma(i, i) = std::max(out.sigma(i, i), 1e-14 * YY_(i, i) / static_cast<double>(windows_));
  }
  return out;
}

}  // namespace identikal
