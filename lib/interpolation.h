// What is the value between two samples?
#pragma once

#include <Eigen/Core>

namespace identikal {

/// Piecewise cubic Hermite interpolation that keeps the data's shape: continuous slope, no
/// overshoot between samples. Slopes are the weighted harmonic mean of the neighbouring chords
/// (Fritsch & Butland 1984) within the monotonicity region of Fritsch & Carlson (1980); this is the
/// "pchip" that Sladká (2010), section 9.1, puts between the samples of the inputs.
class Pchip {
 public:
  /// @param x  N >= 1 strictly increasing abscissae
  /// @param y  N ordinates
  /// @throws std::invalid_argument when the sizes differ, N is 0 or x does not increase
  Pchip(const Eigen::VectorXd& x, const Eigen::VectorXd& y);

  /// Value at `at` inside [x_k, x_(k+1)] of interval k (0-based, k <= N - 2); no search, no check.
  /// A single sample stands for a constant.
  double in_interval(Eigen::Index k, double at) const;
  /// Its derivative there.
  double slope_in_interval(Eigen::Index k, double at) const;

 private:
  /// y = y_k + s h (slope_k + s (c2 + s c3)) with s = (at - x_k)/h.
  struct Cubic {
    double h, s, c2, c3;
  };
  Cubic cubic(Eigen::Index k, double at) const;

  Eigen::VectorXd x_, y_, slope_;
};

}  // namespace identikal
