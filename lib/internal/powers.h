// What do the powers of a stable matrix tell? Its spectral radius, after how many steps it has
// forgotten, and the solutions of the Lyapunov equations X = F X F' + W and M = F' M F + W, by
// doubling. For a size known at compile time (or Dynamic). Internal to lib.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Core>

#include "lib/internal/small_product.h"

namespace identikal {

/// F, F^2, F^4, ... of a stable matrix F.
template <int n>
class Powers {
 public:
  using Square = Eigen::Matrix<double, n, n>;

  /// false when the spectral radius of F is 1 or more, to working precision.
  bool compute(const Square& F) {
    constexpr double kVanished = 1e-30;
    count_ = 0;
    Square power = F;
    double log_size = 0.0;
    // 2^52 steps: a spectral radius of 1 - 1e-14 has decayed, one of 1 has not.
    for (; count_ < 52; ++count_) {
      log_size = std::log(power.cwiseAbs().maxCoeff());
      if (!(log_size < 700.0)) return false;
      power_[count_] = power;
      if (log_size < std::log(kVanished)) break;
      set_product(scratch_, power, power);
      power.swap(scratch_);
    }
    if (count_ == 52) return false;
    // Units of the states enter the size of a power as a factor: on a much higher one it does not
    // matter any more.
    double steps = std::ldexp(1.0, count_);
    radius_ = 0.0;
    for (int more = 0; more < 3 && log_size > -1e300; ++more) {
      const double scale = std::exp(log_size);
      radius_ = std::exp(log_size / steps);
      if (scale < 1e-140) break;
      set_product(scratch_, power, power);
      power.swap(scratch_);
      steps *= 2.0;
      log_size = std::log(power.cwiseAbs().maxCoeff());
    }
    return true;
  }

  double radius() const { return radius_; }
  int count() const { return count_; }  ///< of F, F^2, F^4, ... until they have vanished
  const Square& power(int j) const { return power_[j]; }

  /// Steps after which F^t has vanished, to rounding.
  Eigen::Index memory() const {
    constexpr double kForgotten = -41.5;  // log 1e-18
    const Eigen::Index margin = power_[0].rows() + 2;
    if (!(radius_ > 1e-8)) return margin + 2;
    return margin +
           static_cast<Eigen::Index>(std::min(1e9, std::ceil(kForgotten / std::log(radius_))));
  }

  /// The solution of X = F X F' + W, n x n, in place of W.
  void sum_forward(Square& X) const {
    Square step;
    for (int j = 0; j < count_; ++j) {
      const Square& P = power_[j];
      set_product(step, P, X);
      add_product(X, step, P.transpose());
    }
  }

  /// The solution of M = F' M F + W, n x n, in place of W.
  void sum_backward(Square& X) const {
    Square step;
    for (int j = 0; j < count_; ++j) {
      const Square& P = power_[j];
      set_product(step, P.transpose(), X);
      add_product(X, step, P);
    }
  }

 private:
  std::array<Square, 53> power_;
  Square scratch_;
  int count_ = 0;
  double radius_ = 0.0;
};

}  // namespace identikal
