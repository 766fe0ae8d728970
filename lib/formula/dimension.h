// Do the units of a formula fit together?
#pragma once

#include <span>
#include <string>

#include "lib/data/units.h"
#include "lib/formula/expression.h"

namespace identikal {

/// Fractions too: sqrt(m) is m^0.5. Angles have none.
struct Dimension {
  Exponents exponent{};
  /// A plain number, such as the 5 of vx > 5, means SI where it is compared with a quantity or
  /// stands beside one in min, max, if, atan2 or hypot, and where it is all of a formula. In sums
  /// only 0 does.
  bool plain = false;
};

/// Of what is measured in that unit; its scale and offset do not count.
Dimension dimension_of(const Unit& unit);

/// The same exponents, or one of the two is plain.
bool fits(const Dimension& a, const Dimension& b);

/// In words: "a force (kg m/s^2)", "a number (no dimension)", "m^0.5/s".
std::string in_words(const Dimension& dimension);

/// The dimension of a formula. Sums, comparisons, min, max, atan2, hypot and the two sides of a
/// choice need operands that fit; functions such as sin and exp, and exponents, need numbers; the
/// exponent of what has a dimension must not hold a symbol.
///
/// Example:
///
///     const std::vector<std::string> names{"m", "vx"};
///     const Dimension of[] = {dimension_of(*parse_unit("kg")), dimension_of(*parse_unit("m/s"))};
///     const Dimension energy = dimension_of(parse_expression("m*vx^2/2", names), of);
///     std::puts(in_words(energy).c_str());  // an energy or a torque (kg m^2/s^2)
///
/// @param symbols  dimension of each symbol
/// @throws FormulaError at the operator or function whose operands do not fit, with both in words
Dimension dimension_of(const Expression& expression, std::span<const Dimension> symbols);

/// Throws FormulaError at the formula's outermost operation unless it has the dimension `wanted`.
/// @param what  has that dimension, e.g. "the rate of change of 'vy'"
void check_dimension(const Expression& expression, std::span<const Dimension> symbols,
                     const Dimension& wanted, const std::string& what);

}  // namespace identikal
