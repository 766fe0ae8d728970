// Below which number does a given share of some numbers lie?
#pragma once

#include <vector>

namespace identikal {

/// The sample quantile of type 7 in Hyndman & Fan (1996, The American Statistician 50(4), 361-365),
/// as numpy and R take it by default: position p (n - 1) among the numbers in order, counted from
/// 0, with straight lines in between. NaN of none.
///
/// Example:
///
///     const double worst = quantile({0.3, 0.1, 0.2, 0.9}, 0.95);  // 95 % of the numbers lie below
///
/// @param values  none of them NaN
/// @param p       0 <= p <= 1: 0 gives the least of them, 1 the largest
double quantile(std::vector<double> values, double p);

}  // namespace identikal
