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

/// Piecewise linear interpolation of the samples that are there: between two of them no further
/// apart than `widest`; NaN in a wider gap, before the first and after the last (nothing is
/// extrapolated). At a sample's own time, its value.
///
/// Example:
///
///     const double widest = kBridgedPeriods * own_period(time, y.row(0));
///     const Eigen::VectorXd at = Eigen::VectorXd::LinSpaced(1000, time[0], time[time.size() - 1]);
///     const Eigen::VectorXd value = interpolate_linearly(time, y.row(0), at, widest);
///
/// @param t       N increasing times of the samples
/// @param x       N values, NaN = missing
/// @param at      M increasing times requested
/// @param widest  widest gap bridged, in the unit of t
/// @throws std::invalid_argument when the sizes of t and x differ
Eigen::VectorXd interpolate_linearly(const Eigen::Ref<const Eigen::VectorXd>& t,
                                     const Eigen::Ref<const Eigen::VectorXd>& x,
                                     const Eigen::Ref<const Eigen::VectorXd>& at, double widest);

/// Median distance in time of neighbouring samples that are there (NaN = missing): the channel's
/// own sampling period [unit of t], whatever the sampling grid it is written on. NaN for fewer than
/// two samples. t and x: N each.
double own_period(const Eigen::Ref<const Eigen::VectorXd>& t,
                  const Eigen::Ref<const Eigen::VectorXd>& x);

/// Gaps up to so many of a channel's own periods are bridged: a lost sample or two, no more.
inline constexpr double kBridgedPeriods = 3.5;

}  // namespace identikal
