#include "lib/formula/dimension.h"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace identikal {
namespace {

using ::testing::HasSubstr;

const std::vector<std::string> kQuantities{"vx", "vy", "r", "m", "a", "Cf", "Iz", "angle", "n"};

std::vector<Dimension> quantities() {
  std::vector<Dimension> out;
  for (const char* unit : {"km/h", "m/s", "deg/s", "kg", "mm", "kN/deg", "kg m^2", "deg", "-"}) {
    out.push_back(dimension_of(*parse_unit(unit)));
  }
  return out;
}

Dimension measure_of(const std::string& text, FormulaKind kind = FormulaKind::number) {
  return dimension_of(parse_expression(text, kQuantities, kind), quantities());
}

std::string mismatch(const std::string& text) {
  try {
    measure_of(text);
  } catch (const FormulaError& error) {
    return error.what();
  }
  return "";
}

TEST(FormulaDimension, OfTheSingleTrackVehicle) {
  const Dimension acceleration = dimension_of(*parse_unit("m/s^2"));
  EXPECT_EQ(measure_of("-Cf/(m*vx)*vy - (vx + a*Cf/(m*vx))*r + Cf/m*angle").exponent,
            acceleration.exponent);
  EXPECT_EQ(measure_of("-a*Cf/(Iz*vx)*vy - a^2*Cf/(Iz*vx)*r").exponent,
            dimension_of(*parse_unit("rad/s^2")).exponent);
}

TEST(FormulaDimension, MistakesAreNamedAtTheOperator) {
  const struct {
    const char *text, *message;
  } cases[] = {
      {"Cf + m", "column 4: '+' between a force (kg m/s^2) and a mass (kg); expected the same"},
      {"vx*(Cf - vy)", "column 8: '-' between a force (kg m/s^2) and a speed (m/s)"},
      {"vx + 1",
       "column 4: '+' between a speed (m/s) and a number (no dimension); expected the "
       "same dimension on both sides; declare the number"},
      {"sin(a)", "column 1: 'sin' of a length (m); expected a number or an angle"},
      {"exp(vx*n)", "column 1: 'exp' of a speed (m/s)"},
      {"a^n", "column 2: '^' of a length (m) with an exponent that is not constant"},
      {"n^a", "column 2: '^' with an exponent that is a length (m)"},
      {"if(vx > m, 1, 2)", "column 7: '>' between a speed (m/s) and a mass (kg)"},
      {"if(vx > vy, a, m)", "column 1: 'if' chooses between a length (m) and a mass (kg)"},
      {"min(vx, a)", "column 1: 'min' between a speed (m/s) and a length (m)"},
      {"atan2(vy, a)", "column 1: 'atan2' between"},
      {"g + vx", "between an acceleration (m/s^2) and a speed (m/s)"},
      {"sqrt(a) + a", "between m^0.5 and a length (m)"},
      {"m*r^3/a + n", "between kg/(m s^3) and a number"},
      {"a^2000", "a dimension with a power beyond 1000"},
      {"a^(0/0)", "a dimension with a power beyond 1000"},
  };
  for (const auto& c : cases) EXPECT_THAT(mismatch(c.text), HasSubstr(c.message)) << c.text;
}

TEST(FormulaDimension, PlainNumbersAreSi) {
  EXPECT_EQ(mismatch("if(vx > 5, max(vx, 2*3), 0)"), "");
  EXPECT_EQ(mismatch("vx + 0"), "");
  EXPECT_EQ(mismatch("hypot(vx, 0.1) + vy"), "");
  EXPECT_EQ(measure_of("max(1, vx)").exponent, measure_of("vx").exponent);
  EXPECT_TRUE(measure_of("2*pi/3").plain);
  EXPECT_FALSE(measure_of("2*n").plain);
  EXPECT_TRUE(fits(measure_of("5"), measure_of("vx")));
  EXPECT_FALSE(fits(measure_of("5*n"), measure_of("vx")));
}

TEST(FormulaDimension, PowersAndRoots) {
  EXPECT_TRUE(fits(measure_of("sqrt(vx^2 + vy^2)"), measure_of("vx")));
  EXPECT_TRUE(fits(measure_of("(a^2)^(1/2)"), measure_of("a")));
  EXPECT_TRUE(fits(measure_of("a^(1/3)*a^(1/3)*a^(1/3)"), measure_of("a")));
  EXPECT_TRUE(fits(measure_of("sqrt(a)*sqrt(a)"), measure_of("a")));
  EXPECT_TRUE(fits(measure_of("(vx/vy)^n"), measure_of("n")));
  EXPECT_TRUE(fits(measure_of("sign(vx)"), measure_of("n")));
}

TEST(FormulaDimension, OfAWholeFormula) {
  const std::vector<Dimension> known = quantities();
  const Expression formula = parse_expression("Cf/m*vx", kQuantities);
  try {
    check_dimension(formula, known, measure_of("Cf/m"), "the rate of change of 'vy'");
    FAIL();
  } catch (const FormulaError& error) {
    EXPECT_THAT(error.what(), HasSubstr("column 5: the formula is m^2/s^3; expected an "
                                        "acceleration (m/s^2), as the rate of change of 'vy' is"));
  }
  EXPECT_NO_THROW(
      check_dimension(parse_expression("0", kQuantities), known, measure_of("Cf/m"), ""));
}

}  // namespace
}  // namespace identikal
