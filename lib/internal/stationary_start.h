// Where does a stable model start that has run for ever, and how does that move with its matrices?
// Internal to the library.
#pragma once

#include <Eigen/Core>

#include "lib/internal/powers.h"

namespace identikal {

/// P = A P A' + W, n x n; the powers of A that solve it serve its derivatives too.
class StationaryStart {
 public:
  /// false unless A is stable.
  bool compute(const Eigen::MatrixXd& A, const Eigen::MatrixXd& W) {
    if (!powers_.compute(A)) return false;
    P_ = W;
    powers_.sum_forward(P_);
    PA_ = P_ * A.transpose();
    return P_.allFinite();
  }

  const Eigen::MatrixXd& P() const { return P_; }
  const Eigen::MatrixXd& PA() const { return PA_; }  ///< P A'
  const Powers<Eigen::Dynamic>& powers() const { return powers_; }

  /// dP = A dP A' + dA P A' + A P dA' + dW
  Eigen::MatrixXd derivative(const Eigen::MatrixXd& dA, const Eigen::MatrixXd& dW) const {
    const Eigen::MatrixXd half = dA * PA_;
    Eigen::MatrixXd out = half + half.transpose() + dW;
    powers_.sum_forward(out);
    return out;
  }

 private:
  Powers<Eigen::Dynamic> powers_;
  Eigen::MatrixXd P_, PA_;
};

}  // namespace identikal
