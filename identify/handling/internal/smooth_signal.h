// What are value, slope and curvature of a noisy signal at a moment?
#pragma once

#include <Eigen/Core>

#include "identify/estimate/none.h"

namespace identikal {

/// The parabola of least squares through the samples around a moment.
struct LocalParabola {
  double value = kNone, slope = kNone, curvature = kNone;
  double value_gain = kNone, slope_gain = kNone;  ///< standard errors over that of a sample
};

/// Half the width of the parabolas for rising edges, and for peaks, which are wider [s].
inline constexpr double kOfEdges = 0.04, kOfPeaks = 0.12;

/// Rows of a signal as local parabolas of that half width, or of two samples to each side where
/// rows are further apart (Savitzky & Golay 1964): what they follow they do not flatten.
///
/// Example:
///
///     const SmoothSignal smooth(time, y.row(0), kOfEdges);
///     const LocalParabola at = smooth.at(0.5);
class SmoothSignal {
 public:
  /// @param time  N rising times [s]; @param x  N samples, NaN = missing
  SmoothSignal(const Eigen::Ref<const Eigen::VectorXd>& time,
               const Eigen::Ref<const Eigen::VectorXd>& x, double half_width);

  /// NaN where fewer than four samples lie around.
  LocalParabola at(double moment) const;
  double time(Eigen::Index row) const { return time_[row]; }
  Eigen::Index rows() const { return time_.size(); }
  /// Of the samples about their parabolas.
  double noise_sd() const { return noise_sd_; }

 private:
  Eigen::VectorXd time_, x_;
  double half_width_, noise_sd_ = 0.0;
};

}  // namespace identikal
