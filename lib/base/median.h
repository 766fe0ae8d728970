// What lies in the middle of some numbers?
#pragma once

#include <vector>

namespace identikal {

/// Of an even number of them, the larger of the two in the middle.
///
/// Example:
///
///     const double typical = median({0.3, -0.1, 0.2, 9.0, 0.1});  // 0.2
///
/// @param values  one or more, none of them NaN
double median(std::vector<double> values);

/// The standard deviation of zero-mean normal numbers in medians of their sizes.
inline constexpr double kDeviationPerMedian = 1.4826;

}  // namespace identikal
