// Where does a stable model start that has run for ever, and how does that move with its matrices?
// Internal to the library.
#pragma once

#include <cmath>
#include <cstdlib>
#include <optional>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/LU>

#include "lib/internal/powers.h"

namespace identikal {

/// Autocovariances g_0 ... g_n of x(t) = phi_1 x(t-1) + ... + phi_n x(t-n) + e, by the equations of
/// Yule and Walker,
///
///   g_j - sum_i phi_i g_|j-i| = b_j,  b = [var e, 0, ..., 0].
///
/// Those up to the last phi that is not zero are solved together, with one step of refinement in higher
/// precision, as near the unit circle their condition is bad; the others follow one by one.
class YuleWalker {
 public:
  explicit YuleWalker(Eigen::RowVectorXd phi) : phi_(std::move(phi)), order_(phi_.size()) {
    while (order_ > 0 && phi_[order_ - 1] == 0.0) --order_;
    Eigen::MatrixXd M = Eigen::MatrixXd::Identity(order_ + 1, order_ + 1);
    for (Eigen::Index j = 0; j <= order_; ++j) {
      for (Eigen::Index i = 1; i <= order_; ++i) M(j, std::abs(j - i)) -= phi_[i - 1];
    }
    lu_.compute(M);
  }

  Eigen::VectorXd solve(const Eigen::VectorXd& b) const {
    Eigen::VectorXd g = b;
    g.head(order_ + 1) = lu_.solve(b.head(order_ + 1));
    Eigen::VectorXd rest(order_ + 1);
    for (Eigen::Index j = 0; j <= order_; ++j) {
      rest[j] = static_cast<double>(static_cast<long double>(b[j]) - g[j] + sum_before(g, j));
    }
    g.head(order_ + 1) += lu_.solve(rest);
    for (Eigen::Index j = order_ + 1; j < g.size(); ++j) {
      g[j] = static_cast<double>(b[j] + sum_before(g, j));
    }
    return g;
  }

 private:
  // sum_i phi_i g_|j-i|
  long double sum_before(const Eigen::VectorXd& g, Eigen::Index j) const {
    long double sum = 0.0;
    for (Eigen::Index i = 1; i <= order_; ++i) {
      sum += static_cast<long double>(phi_[i - 1]) * g[std::abs(j - i)];
    }
    return sum;
  }

  Eigen::RowVectorXd phi_;
  Eigen::Index order_;  // the last phi that is not zero
  Eigen::PartialPivLU<Eigen::MatrixXd> lu_;
};

/// P = A P A' + W, n x n. Of a register, the samples x(t), x(t-1), ... of an autoregression, by its
/// autocovariances; else by powers of A, which serve the derivatives too.
class StationaryStart {
 public:
  /// false unless A is stable.
  bool compute(const Eigen::MatrixXd& A, const Eigen::MatrixXd& W) {
    A_ = A;
    powers_known_ = false;
    yule_walker_.reset();
    if (is_register(A, 1.0) && drives_first_alone(W) && W(0, 0) > 0.0 &&
        compute_register(W(0, 0))) {
      PA_ = P_ * A.transpose();
      return true;
    }
    yule_walker_.reset();
    if (!find_powers()) return false;
    P_ = W;
    powers_.sum_forward(P_);
    PA_ = P_ * A.transpose();
    return P_.allFinite();
  }

  const Eigen::MatrixXd& P() const { return P_; }
  const Eigen::MatrixXd& PA() const { return PA_; }  ///< P A'
  /// Of A. @returns null where they do not vanish, which rounding may hide from compute()
  const Powers<Eigen::Dynamic>* powers() { return find_powers() ? &powers_ : nullptr; }

  /// Does this derivative leave a register a register?
  bool is_quick(const Eigen::MatrixXd& dA, const Eigen::MatrixXd& dW) const {
    return yule_walker_ && is_register(dA, 0.0) && drives_first_alone(dW);
  }

  /// dP = A dP A' + dA P A' + A P dA' + dW
  Eigen::MatrixXd derivative(const Eigen::MatrixXd& dA, const Eigen::MatrixXd& dW) {
    if (is_quick(dA, dW)) return register_derivative(dA.row(0), dW(0, 0));
    const Eigen::MatrixXd half = dA * PA_;
    Eigen::MatrixXd out = half + half.transpose() + dW;
    if (!find_powers()) return Eigen::MatrixXd::Constant(A_.rows(), A_.rows(), NAN);
    powers_.sum_forward(out);
    return out;
  }

 private:
  // Rows behind the first move what is there on by one; `one`: 0 in a derivative.
  static bool is_register(const Eigen::MatrixXd& A, double one) {
    for (Eigen::Index i = 1; i < A.rows(); ++i) {
      for (Eigen::Index j = 0; j < A.cols(); ++j) {
        if (A(i, j) != (j == i - 1 ? one : 0.0)) return false;
      }
    }
    return A.rows() > 1;
  }

  static bool drives_first_alone(const Eigen::MatrixXd& W) {
    for (Eigen::Index j = 0; j < W.cols(); ++j) {
      for (Eigen::Index i = 0; i < W.rows(); ++i) {
        if (i + j > 0 && W(i, j) != 0.0) return false;
      }
    }
    return true;
  }

  static Eigen::MatrixXd toeplitz(const Eigen::VectorXd& g) {
    const Eigen::Index n = g.size() - 1;
    Eigen::MatrixXd out(n, n);
    for (Eigen::Index j = 0; j < n; ++j) {
      for (Eigen::Index i = 0; i < n; ++i) out(i, j) = g[std::abs(i - j)];
    }
    return out;
  }

  // A is stable where the only solution is positive definite. false: powers decide, whose errors are
  // alike in neighbours; what an output sees of large autocovariances may be their differences.
  bool compute_register(double variance) {
    yule_walker_.emplace(A_.row(0));
    Eigen::VectorXd b = Eigen::VectorXd::Zero(A_.rows() + 1);
    b[0] = variance;
    g_ = yule_walker_->solve(b);
    constexpr double kLarge = 1e3;  // beside the noise: near the unit circle
    if (!(std::abs(g_[0]) < kLarge * variance)) return false;
    P_ = toeplitz(g_);
    return Eigen::LLT<Eigen::MatrixXd>(P_).info() == Eigen::Success;
  }

  Eigen::MatrixXd register_derivative(const Eigen::RowVectorXd& dphi, double dvariance) const {
    Eigen::VectorXd b = Eigen::VectorXd::Zero(g_.size());
    b[0] = dvariance;
    for (Eigen::Index i = 1; i < g_.size(); ++i) {
      if (dphi[i - 1] == 0.0) continue;
      for (Eigen::Index j = 0; j < g_.size(); ++j) b[j] += dphi[i - 1] * g_[std::abs(j - i)];
    }
    return toeplitz(yule_walker_->solve(b));
  }

  bool find_powers() {
    if (!powers_known_) has_powers_ = powers_.compute(A_);
    powers_known_ = true;
    return has_powers_;
  }

  Eigen::MatrixXd A_, P_, PA_;
  std::optional<YuleWalker> yule_walker_;
  Eigen::VectorXd g_;
  Powers<Eigen::Dynamic> powers_;
  bool powers_known_ = false, has_powers_ = false;
};

}  // namespace identikal
