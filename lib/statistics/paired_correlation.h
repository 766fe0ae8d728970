// How alike are two series, of which samples may be missing?
#pragma once

#include <limits>

#include <Eigen/Core>

namespace identikal {

struct PairedCorrelation {
  /// sum (x - mean x)(y - mean y) / sqrt(sum (x - mean x)^2 sum (y - mean y)^2), -1 to 1
  double correlation = std::numeric_limits<double>::quiet_NaN();
  /// sqrt(sum (y - mean y)^2 / sum (x - mean x)^2): what y is larger by, of unit y over unit x
  double slope = std::numeric_limits<double>::quiet_NaN();
  Eigen::Index count = 0;  ///< samples that both have
};

/// Over the samples that are there (not NaN) in both; a series that is constant there, to within
/// rounding, has neither correlation nor slope (NaN).
///
/// Example:
///
///     const PairedCorrelation alike = paired_correlation(y.row(0), y.row(1));
///     if (alike.correlation < -0.5) std::puts("one of the two has the wrong sign");
///
/// @param x, y  N each
PairedCorrelation paired_correlation(const Eigen::Ref<const Eigen::VectorXd>& x,
                                     const Eigen::Ref<const Eigen::VectorXd>& y);

}  // namespace identikal
