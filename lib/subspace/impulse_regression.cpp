#include "lib/subspace/impulse_regression.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <Eigen/Cholesky>

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

VectorXd powers(double base, Index count) {
  return VectorXd::LinSpaced(count, 0.0, static_cast<double>(count - 1)).unaryExpr([&](double k) {
    return std::pow(base, k);
  });
}

}  // namespace

MatrixXd kernel_matrix(const KernelPrior& prior, Index rows) {
  // From the first row on as if it were the second: at its begin the spline would be tied to zero slope.
  const VectorXd decay = powers(prior.decay, rows + 1).tail(rows),
                 root = powers(std::sqrt(prior.decay), rows + 1).tail(rows),
                 correlation = powers(prior.correlation, rows);
  const auto value = [&](Index low, Index high) {
    switch (prior.kernel) {
      case Kernel::diagonal_correlated:
        return root[low] * root[high] * correlation[high - low];
      case Kernel::stable_spline:
        return decay[high] * decay[high] * (decay[low] / 2.0 - decay[high] / 6.0);
      case Kernel::tuned_correlated:
        break;
    }
    return decay[high];
  };
  const VectorXd apart = powers(prior.slow_correlation, rows),
                 slow = powers(std::exp(-2.0 / static_cast<double>(rows)), rows);
  MatrixXd out(rows, rows);
  for (Index k = 0; k < rows; ++k) {
    for (Index l = 0; l <= k; ++l) {
      out(k, l) = out(l, k) =
          prior.size * value(l, k) + prior.slow_size * slow[k] * slow[l] * apart[k - l];
    }
  }
  return out;
}

struct ImpulseRegression::Posterior {
  MatrixXd root;  // of the kernel, one input
  Eigen::LLT<MatrixXd> factor;
  MatrixXd b;
  VectorXd variance;
};

ImpulseRegression::ImpulseRegression(const LaggedProducts& sums)
    : p_(sums.outputs), m_(sums.inputs), lags_(sums.lags), windows_(sums.windows) {
  if (m_ == 0) throw std::invalid_argument("ImpulseRegression: without inputs no response");
  const Index q = p_ + m_;
  Eigen::VectorXi order(m_ * (lags_ + 1));
  for (Index j = 0, row = 0; j < m_; ++j) {
    for (Index lag = 0; lag <= lags_; ++lag) order[row++] = static_cast<int>(lag * q + p_ + j);
  }
  S_ = sums.gram(order, order);
  F_ = sums.gram(order, Eigen::seqN(0, p_));
  YY_ = sums.gram.diagonal().head(p_);
}

ImpulseRegression::Posterior ImpulseRegression::posterior(const KernelPrior& prior) const {
  Posterior out;
  const Index n = lags_ + 1;
  MatrixXd kernel = kernel_matrix(prior, n);
  kernel.diagonal() *= 1.0 + 1e-10;
  kernel.diagonal().array() += 1e-14 * kernel(0, 0);
  out.root = Eigen::LLT<MatrixXd>(kernel).matrixL();
  MatrixXd M(S_.rows(), S_.cols()), b(F_.rows(), F_.cols());
  const auto upper = out.root.transpose().triangularView<Eigen::Upper>();
  const auto lower = out.root.triangularView<Eigen::Lower>();
  for (Index i = 0; i < m_; ++i) {
    for (Index j = 0; j <= i; ++j) {
      const MatrixXd half = upper * S_.block(i * n, j * n, n, n);
      M.block(i * n, j * n, n, n) = half * lower;
    }
    b.middleRows(i * n, n) = upper * F_.middleRows(i * n, n);
  }
  M.diagonal().array() += 1.0;
  out.factor.compute(M);
  out.b = out.factor.matrixL().solve(b);
  // What is left of an output that is explained exactly is rounding.
  const VectorXd left = YY_ - out.b.colwise().squaredNorm().transpose();
  out.variance = left.cwiseMax(1e-14 * YY_).cwiseMax(1e-300) / static_cast<double>(windows_);
  return out;
}

double ImpulseRegression::log_evidence(const KernelPrior& prior) const {
  const Posterior at = posterior(prior);
  return -0.5 * static_cast<double>(windows_) * at.variance.array().log().sum() -
         static_cast<double>(p_) * at.factor.matrixLLT().diagonal().array().log().sum();
}

ImpulseRegression::Responses ImpulseRegression::estimate(const KernelPrior& prior) const {
  const Posterior at = posterior(prior);
  const Index n = lags_ + 1;
  const MatrixXd f = at.factor.matrixU().solve(at.b);
  const MatrixXd V = at.factor.solve(MatrixXd::Identity(S_.rows(), S_.cols()));
  Responses out{MatrixXd(S_.rows(), p_), MatrixXd(S_.rows(), p_)};
  const VectorXd sd = at.variance.cwiseSqrt();
  for (Index j = 0; j < m_; ++j) {
    out.value.middleRows(j * n, n) = at.root * f.middleRows(j * n, n);
    const MatrixXd covariance = at.root * V.block(j * n, j * n, n, n) * at.root.transpose();
    out.se.middleRows(j * n, n) = covariance.diagonal().cwiseMax(0.0).cwiseSqrt() * sd.transpose();
  }
  return out;
}

}  // namespace identikal
