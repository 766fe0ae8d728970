// How does a tape read as statements of a programming language?
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "lib/formula/tape.h"

namespace identikal {

enum class CodeLanguage {
  c,       ///< and C++: doubles, functions of math.h
  python,  ///< functions of numpy as np
};

/// What a tape computes, as text.
struct TapeCode {
  /// In their order, without declaration and end of line: "t1 = sin(x[0])". A number that is used
  /// once stands where it is used.
  std::vector<std::string> statements;
  std::vector<std::string> values;    ///< of the formulas
  std::vector<std::string> jacobian;  ///< row by row; "0.0" where it is zero for every argument
};

/// Everything that the values and the first columns of the Jacobian need, held symbols too. The code
/// gives the numbers of evaluate_jacobian(), but for rounding.
///
/// Example:
///
///     const std::vector<std::string> names{"x", "p"};
///     const std::vector<Expression> formulas{parse_expression("p*sin(x)", names)};
///     const Tape tape = compile(formulas, {false, true}, std::array{0});
///     const TapeCode code = code_of(tape, CodeLanguage::c, {"x[0]", "p"}, 1);
///
/// @param symbols  text of each of the tape's symbols, an expression that needs no parentheses
/// @param columns  of the Jacobian, at most those of the tape
/// @throws std::invalid_argument when the symbols are fewer or the columns more than the tape's
TapeCode code_of(const Tape& tape, CodeLanguage language, const std::vector<std::string>& symbols,
                 std::size_t columns);

/// The shortest text that reads as this very number in both languages, never as an integer;
/// infinity and NaN as expressions.
std::string number_code(double value, CodeLanguage language);

}  // namespace identikal
