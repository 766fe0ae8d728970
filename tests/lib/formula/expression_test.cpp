#include "lib/formula/expression.h"

#include <array>
#include <cmath>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace identikal {
namespace {

using ::testing::HasSubstr;

const std::vector<std::string> kFormulaNames{"x", "y", "Cf", "speed", "\u03B4"};
constexpr std::array<double, 5> kFormulaPoint{2.0, 3.0, 8e4, 20.0, 0.25};

double value_of(const std::string& text, FormulaKind kind = FormulaKind::number) {
  return evaluate(parse_expression(text, kFormulaNames, kind), kFormulaPoint);
}

// The message, or "" when the text is read.
std::string formula_refusal(const std::string& text, FormulaKind kind = FormulaKind::number) {
  try {
    parse_expression(text, kFormulaNames, kind);
  } catch (const FormulaError& error) {
    return error.what();
  }
  return "";
}

TEST(Expression, PrecedenceIsThatOfMathematics) {
  EXPECT_EQ(value_of("1 + 2*3"), 7.0);
  EXPECT_EQ(value_of("10 - 4 - 3"), 3.0);
  EXPECT_EQ(value_of("24/4/2"), 3.0);
  EXPECT_EQ(value_of("24/4*2"), 12.0);
  EXPECT_EQ(value_of("2^3^2"), 512.0);
  EXPECT_EQ(value_of("-x^2"), -4.0);
  EXPECT_EQ(value_of("2^-1"), 0.5);
  EXPECT_EQ(value_of("2^-2^2"), 1.0 / 16.0);
  EXPECT_EQ(value_of("x*-y"), -6.0);
  EXPECT_EQ(value_of("--x"), 2.0);
  EXPECT_EQ(value_of("+x - +y"), -1.0);
  EXPECT_EQ(value_of("(1 + 2)*3"), 9.0);
  EXPECT_EQ(value_of(" x\t*\ny "), 6.0);
}

TEST(Expression, Numbers) {
  EXPECT_EQ(value_of("1e3"), 1000.0);
  EXPECT_EQ(value_of("1.5e-3"), 0.0015);
  EXPECT_EQ(value_of(".5"), 0.5);
  EXPECT_EQ(value_of("5."), 5.0);
  EXPECT_EQ(value_of("2-1"), 1.0);
}

TEST(Expression, Functions) {
  EXPECT_EQ(value_of("sin(x)"), std::sin(2.0));
  EXPECT_EQ(value_of("atan2(y, x)"), std::atan2(3.0, 2.0));
  EXPECT_EQ(value_of("hypot(y, 4)"), 5.0);
  EXPECT_EQ(value_of("log(exp(1))"), 1.0);
  EXPECT_EQ(value_of("log10(1000)"), 3.0);
  EXPECT_EQ(value_of("min(x, y, 1, 5)"), 1.0);
  EXPECT_EQ(value_of("max(x, y, 1, 5)"), 5.0);
  EXPECT_EQ(value_of("pow(x, y)"), 8.0);
  EXPECT_EQ(value_of("sign(-x) + sign(0) + sign(y)"), 0.0);
  EXPECT_EQ(value_of("floor(-2.5)"), -3.0);
  EXPECT_EQ(value_of("cos(pi)"), -1.0);
  EXPECT_EQ(value_of("g"), 9.80665);
  EXPECT_EQ(value_of("\u03B4"), 0.25);
}

TEST(Expression, ConditionsAndChoices) {
  EXPECT_EQ(value_of("if(x < y, 10, 20)"), 10.0);
  EXPECT_EQ(value_of("if(not x < y, 10, 20)"), 20.0);
  EXPECT_EQ(value_of("if(x > y or x == 2 and y != 4, 1, 0)"), 1.0);
  EXPECT_EQ(value_of("if((x > y or x == 2) and y == 4, 1, 0)"), 0.0);
  EXPECT_EQ(value_of("speed > 5", FormulaKind::condition), 1.0);
  EXPECT_EQ(value_of("speed >= 20 and speed <= 20", FormulaKind::condition), 1.0);
}

TEST(Expression, ASymbolHidesAConstant) {
  const std::vector<std::string> names{"g"};
  const std::array<double, 1> point{1.5};
  EXPECT_EQ(evaluate(parse_expression("2*g", names), point), 3.0);
}

TEST(Expression, MistakesAreNamedWithTheirColumn) {
  const struct {
    const char *text, *message;
  } cases[] = {
      {"", "column 1: the formula ends; expected a number, a name, a function or '('"},
      {"x +", "column 4: the formula ends; expected a number"},
      {"x + * y", "column 5: '*'; expected a number"},
      {"(x + y", "column 7: the formula ends; expected ')' or an operator"},
      {"x + y)", "column 6: ')'; expected an operator such as '+', or the end"},
      {"2 x", "column 3: 'x'; expected an operator such as '+', or the end; a product needs '*'"},
      {"x(y)", "column 1: 'x' is not a function; a product needs '*'"},
      {"x*spede",
       "column 3: unknown name 'spede'; expected a name that the model declares; did "
       "you mean 'speed'?"},
      {"x*sim(y)",
       "column 3: unknown function 'sim'; expected sin, cos, exp, log, sqrt, min, if, "
       "...; did you mean 'sin'?"},
      {"\u03B4*\u03B4*spede", "column 5: unknown name 'spede'"},
      {"sin + x", "column 1: 'sin' without arguments; expected 'sin('"},
      {"atan2(x)", "column 1: 'atan2' with 1 argument; expected 2"},
      {"sin(x, y)", "column 1: 'sin' with 2 arguments; expected 1"},
      {"min(x)", "column 1: 'min' with 1 argument; expected at least 2"},
      {"x \u2212 y",
       "column 3: '\u2212' is not the minus sign '-'; expected the sign of the keyboard"},
      {"x\u00B7y",
       "column 2: '\u00B7' is not the product sign '*'; expected the sign of the keyboard"},
      {"x\u00B2", "column 2: '\u00B2' is not the power '^2'"},
      {"x**2",
       "column 2: '**'; expected an operator such as '+', or the end; a power is written ^"},
      {"if(x > 1 && y > 1, x, y)", "write 'and'"},
      {"if(x = 1, x, y)", "column 6: '='; expected ')' or an operator; equality is written =="},
      {"x > 1 ? x : y", "a choice is written if(condition, then, else)"},
      {"if(x, 1, 2)", "column 4: a number where a condition belongs; expected a comparison"},
      {"1 + (x > 2)", "column 8: a condition ('>') where a number belongs"},
      {"x > 2", "column 3: a condition ('>') where a number belongs"},
      {"if(1 < x < 3, 1, 2)",
       "column 10: a second comparison; expected one; write a < b and b < c"},
      {"1e999", "column 1: '1e999' is out of range"},
      {"x and y", "column 1: a number where a condition belongs"},
      {"and", "column 1: 'and'; expected a number"},
      {"x $ y", "column 3: '$'; expected an operator"},
  };
  for (const auto& c : cases) EXPECT_THAT(formula_refusal(c.text), HasSubstr(c.message)) << c.text;
  EXPECT_THAT(formula_refusal("x", FormulaKind::condition),
              HasSubstr("column 1: a number where a condition belongs"));
}

TEST(Expression, SizeAndDepthAreLimited) {
  EXPECT_THAT(formula_refusal(std::string(200, '(') + "x" + std::string(200, ')')),
              HasSubstr("nesting deeper than 100 levels"));
  EXPECT_EQ(formula_refusal(std::string(90, '(') + "x" + std::string(90, ')')), "");
  EXPECT_THAT(formula_refusal(std::string(5000, '-') + "x"), HasSubstr("nesting deeper"));
  std::string tower = "x", chain = "x";
  for (int i = 0; i < 500; ++i) tower += "^x";
  for (int i = 0; i < 4000; ++i) chain += "+x";
  EXPECT_THAT(formula_refusal(tower), HasSubstr("nesting deeper"));
  EXPECT_EQ(value_of(chain), 8002.0);
  EXPECT_THAT(formula_refusal(chain + chain), HasSubstr("16002 bytes; expected at most 10000"));
}

TEST(Expression, AMistakeFindsItsPlaceInAFile) {
  try {
    parse_expression("x + ", kFormulaNames);
    FAIL();
  } catch (const FormulaError& error) {
    EXPECT_EQ(error.column(), 5);
    EXPECT_THAT(error.in_file({"car.yaml", 12, 11}).what(),
                HasSubstr("car.yaml:12:11: the formula"));
  }
}

TEST(Expression, ReservedWords) {
  for (const char* word : {"sin", "if", "and", "pow", "min"}) EXPECT_TRUE(is_reserved_word(word));
  for (const char* word : {"x", "pi", "g", "number"}) EXPECT_FALSE(is_reserved_word(word));
}

}  // namespace
}  // namespace identikal
