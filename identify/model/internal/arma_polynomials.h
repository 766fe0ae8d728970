// Which formulas are the coefficients of a seasonal autoregression and moving average, multiplied out?
#pragma once

#include <map>
#include <string>
#include <vector>

namespace identikal {

/// Formulas by lag; the one at lag 0 is 1 and is not there.
using LagPolynomial = std::map<int, std::string>;

/// sum_k sign c_k z^(k lag), k = 1, 2, ...: one factor of a polynomial but for its 1.
struct LagFactor {
  std::vector<std::string> coefficients;  ///< formulas of the powers 1, 2, ...
  int lag = 1;
  bool negative = false;
};

/// The product of 1 + factor, but for its 1. Example: 1 - a z times 1 - A z^12:
///
///     const LagPolynomial p = multiplied_out({{{"a"}, 1, true}, {{"A"}, 12, true}});
///     std::puts(p.at(13).c_str());  // (a)*(A)
LagPolynomial multiplied_out(const std::vector<LagFactor>& factors);

/// The same with the opposite signs, as the right side of an autoregression has it.
LagPolynomial right_side(const std::vector<LagFactor>& factors);

/// The right side of (1 - z)^difference (1 - z^period)^seasonal y = 0, as whole numbers.
LagPolynomial differences(int difference, int period, int seasonal);

/// The largest lag, 0 of the polynomial 1.
int order_of(const LagPolynomial& p);

/// sum of the coefficients, each times the state of its lag; "" where there is none.
/// @param states  of the lags `first`, `first` + 1, ...
std::string weighted_sum(const LagPolynomial& p, const std::vector<std::string>& states, int first);

}  // namespace identikal
