// What does a formula say, and what is its value?
#pragma once

#include <cstdint>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "lib/base/error.h"

namespace identikal {

/// What is done with up to three operands. Conditions are numbers too: 1 holds, 0 does not.
enum class Op : std::uint8_t {
  number,
  symbol,
  add,
  subtract,
  multiply,
  divide,
  negate,
  reciprocal,  ///< not in the grammar: a/b is also a (1/b)
  power,
  less,
  less_equal,
  greater,
  greater_equal,
  equal,
  not_equal,
  logical_and,
  logical_or,
  logical_not,
  choose,  ///< if(a, b, c): b where a holds, else c
  sin,
  cos,
  tan,
  asin,
  acos,
  atan,
  atan2,
  sinh,
  cosh,
  tanh,
  exp,
  log,
  log10,
  sqrt,
  abs,
  sign,
  floor,
  min,
  max,
  hypot,
};

/// How many operands an operation has.
int operands(Op op);

/// The operation's sign or name as a person writes it: "+", "atan2".
std::string_view spelling(Op op);

/// The value of an operation other than number and symbol; what it does not need is not read. NaN
/// and infinity where mathematics has no answer. sign(0) = 0.
double apply(Op op, double a, double b = 0.0, double c = 0.0);

/// A mistake in a formula, and where.
class FormulaError : public std::runtime_error {
 public:
  /// @param column  of the formula's text, in characters from 1; 0: the formula as a whole
  /// @param found, expected, hint  as in InputError (lib/base/error.h)
  FormulaError(int column, const std::string& found, const std::string& expected = "",
               const std::string& hint = "");

  int column() const { return column_; }
  /// The same mistake in a file.
  /// @param at  where column() stands there
  InputError in_file(const Location& at) const;

 private:
  int column_;
  std::string found_, expected_, hint_;
};

/// A formula over numbered symbols. It does not change once it was read.
struct Expression {
  struct Node {
    Op op = Op::number;
    int a = -1, b = -1, c = -1;  ///< operands: indices of nodes before this one; -1: none
    double value = 0.0;          ///< Op::number: the number
    int symbol = -1;             ///< Op::symbol: its number
    int column = 0;              ///< of the sign or the name in the text, in characters from 1
    bool gravity = false;        ///< Op::number: it is g, an acceleration
  };
  std::vector<Node> nodes;  ///< never empty once read; the last one is the whole formula
};

/// What a formula has to be where it stands.
enum class FormulaKind {
  number,     ///< has a value
  condition,  ///< holds or does not
};

/// Reads a formula:
///
///   formula  = both { "or" both }                 both  = negated { "and" negated }
///   negated  = [ "not" ] compared                 compared = sum [ ("<" | "<=" | ">" | ">=" | "=="
///                                                              | "!=") sum ]
///   sum      = product { ("+" | "-") product }    product = signed { ("*" | "/") signed }
///   signed   = [ "+" | "-" ] power                power = atom [ "^" signed ]
///   atom     = number | name | function "(" formula { "," formula } ")" | "(" formula ")"
///
/// so that 2^3^2 = 2^9, -x^2 = -(x^2) and 2^-1 = 0.5. A choice is if(condition, then, else): "c ? a
/// : b" would be a mapping in YAML. Functions: sin cos tan asin acos atan atan2(y, x) sinh cosh
/// tanh exp log (natural) log10 sqrt abs sign floor, min and max of two or more, hypot(x, y),
/// pow(x, y). Constants, unless a symbol has that name: pi, g = 9.80665 m/s^2. Numbers carry no
/// units: in "2 m" m may be a mass. A quantity with a unit is declared and named.
///
/// Example:
///
///     const std::vector<std::string> names{"angle", "l"};
///     const Expression formula = parse_expression("-g/l*sin(angle)", names);
///     const double rate = evaluate(formula, std::array{0.3, 0.8});
///
/// @param names  of the symbols; a node's `symbol` is a position here
/// @throws FormulaError for anything else, for a condition where a number belongs and the other way
///   round, for more than 10 000 bytes and for nesting beyond 100 levels
Expression parse_expression(std::string_view text, std::span<const std::string> names,
                            FormulaKind kind = FormulaKind::number);

/// Words with a meaning of their own, which no symbol can have as its name: functions, "if", "and",
/// "or", "not".
bool is_reserved_word(std::string_view name);

/// The formula's value, node by node. @param symbols  as many as there were names
double evaluate(const Expression& expression, std::span<const double> symbols);

}  // namespace identikal
