#include "lib/data/units.h"

#include <numbers>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace identikal {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr Exponents kNumber{};
constexpr Exponents kSpeed{1, 0, -1, 0, 0};
constexpr Exponents kRate{0, 0, -1, 0, 0};
constexpr Exponents kAcceleration{1, 0, -2, 0, 0};
constexpr Exponents kForce{1, 1, -2, 0, 0};
constexpr Exponents kTorque{2, 1, -2, 0, 0};
constexpr Exponents kInertia{2, 1, 0, 0, 0};

struct UnitCase {
  const char* text;
  double scale;
  Exponents dimension;
};

void expect_units(const std::vector<UnitCase>& cases) {
  for (const UnitCase& c : cases) {
    SCOPED_TRACE(c.text);
    const std::optional<Unit> unit = parse_unit(c.text);
    ASSERT_TRUE(unit.has_value());
    EXPECT_NEAR(unit->scale / c.scale, 1.0, 1e-14);
    EXPECT_EQ(unit->dimension, c.dimension);
    EXPECT_EQ(unit->offset, 0.0);
  }
}

TEST(Units, PowersMayBeFractions) {
  expect_units({
      {"m^2.5/s", 1, {2.5, 0, -1}},
      {"cm^0.5", 0.1, {0.5}},
      {"m^(5/2)/s", 1, {2.5, 0, -1}},
      {"(m^3/s)^(1/3)", 1, {1, 0, -1.0 / 3.0}},
      {"m^(-1)", 1, {-1}},
      {"m^-0.5", 1, {-0.5}},
  });
  EXPECT_TRUE(same_dimension(*parse_unit("(m^3)^(1/3)"), *parse_unit("m")));
  EXPECT_FALSE(same_dimension(*parse_unit("m^2.5"), *parse_unit("m^2.4")));
  EXPECT_EQ(si_unit(*parse_unit("mm^2.5/s")), "m^2.5 s^-1");
  for (const char* text : {"m^", "m^(", "m^(1/0)", "m^(1/2", "m^inf", "m^1e3", "m^21", "m^()"}) {
    EXPECT_FALSE(parse_unit(text)) << text;
  }
}

TEST(Units, TableHoldsWhatVehicleAndProcessFilesUse) {
  expect_units({
      {"m", 1, {1}},
      {"mm", 1e-3, {1}},
      {"cm", 1e-2, {1}},
      {"km", 1e3, {1}},
      {"in", 0.0254, {1}},
      {"ft", 0.3048, {1}},
      {"mi", 1609.344, {1}},
      {"s", 1, {0, 0, 1}},
      {"sec", 1, {0, 0, 1}},
      {"ms", 1e-3, {0, 0, 1}},
      {"us", 1e-6, {0, 0, 1}},
      {"ns", 1e-9, {0, 0, 1}},
      {"min", 60, {0, 0, 1}},
      {"h", 3600, {0, 0, 1}},
      {"g", 9.80665, kAcceleration},
      {"kg", 1, {0, 1}},
      {"t", 1e3, {0, 1}},
      {"lb", 0.45359237, {0, 1}},
      {"N", 1, kForce},
      {"kN", 1e3, kForce},
      {"Nm", 1, kTorque},
      {"rad", 1, kNumber},
      {"deg", kPi / 180, kNumber},
      {"mrad", 1e-3, kNumber},
      {"rev", 2 * kPi, kNumber},
      {"Hz", 1, kRate},
      {"rpm", 2 * kPi / 60, kRate},
      {"dps", kPi / 180, kRate},
      {"kph", 1 / 3.6, kSpeed},
      {"kmph", 1 / 3.6, kSpeed},
      {"mph", 0.44704, kSpeed},
      {"kn", 1852.0 / 3600, kSpeed},
      {"K", 1, {0, 0, 0, 0, 1}},
      {"A", 1, {0, 0, 0, 1}},
      {"V", 1, {2, 1, -3, -1}},
      {"W", 1, {2, 1, -3}},
      {"Pa", 1, {-1, 1, -2}},
      {"kPa", 1e3, {-1, 1, -2}},
      {"bar", 1e5, {-1, 1, -2}},
      {"mbar", 100, {-1, 1, -2}},
      {"psi", 0.45359237 * 9.80665 / (0.0254 * 0.0254), {-1, 1, -2}},
      {"l", 1e-3, {3}},
      {"L/min", 1e-3 / 60, {3, 0, -1}},
      {"ml", 1e-6, {3}},
      {"mH", 1e-3, {2, 1, -2, -2}},
      {"V s/A", 1, {2, 1, -2, -2}},
      {"MH", 1e6, {2, 1, -2, -2}},
      {"kHz", 1e3, kRate},
      {"mHz", 1e-3, kRate},
      {"MHz", 1e6, kRate},
      {"mN", 1e-3, kForce},
      {"MN", 1e6, kForce},
      {"Wh", 3600, kTorque},
      {"%", 0.01, kNumber},
  });
}

TEST(Units, OfBuildingsBatteriesAndChemistry) {
  expect_units({
      {"d", 86400, {0, 0, 1}},
      {"days", 86400, {0, 0, 1}},
      {"1/week", 1 / 604800.0, kRate},
      {"hours", 3600, {0, 0, 1}},
      {"MJ/K", 1e6, {2, 1, -2, 0, -1}},
      {"mJ", 1e-3, kTorque},
      {"MWh", 3.6e9, kTorque},
      {"uA", 1e-6, {0, 0, 0, 1}},
      {"nF", 1e-9, {-2, -1, 4, 2}},
      {"MF", 1e6, {-2, -1, 4, 2}},
      {"hPa", 100, {-1, 1, -2}},
      {"mL/min", 1e-6 / 60, {3, 0, -1}},
      {"mol/l", 1e3, {-3, 0, 0, 0, 0, 1}},
      {"mmol/l", 1, {-3, 0, 0, 0, 0, 1}},
      {"kJ/mol", 1e3, {2, 1, -2, 0, 0, -1}},
      {"um", 1e-6, {1}},
      {"arcsec", kPi / 648000, kNumber},
      {"ppm", 1e-6, kNumber},
  });
  // Milligram to some, a thousandth of gravity to others.
  EXPECT_FALSE(parse_unit("mg"));
  EXPECT_EQ(si_unit(*parse_unit("mol/l")), "m^-3 mol");
}

TEST(Units, DimensionlessIsWrittenInSeveralWays) {
  expect_units({{"", 1, kNumber}, {"-", 1, kNumber}, {"1", 1, kNumber}, {"  ", 1, kNumber}});
}

TEST(Units, ProductsQuotientsAndPowers) {
  expect_units({
      {"m/s", 1, kSpeed},
      {"km/h", 1 / 3.6, kSpeed},
      {" km / h ", 1 / 3.6, kSpeed},
      {"m/s^2", 1, kAcceleration},
      {"m/s2", 1, kAcceleration},
      {"m/s**2", 1, kAcceleration},
      {"m/s\u00B2", 1, kAcceleration},
      {"m/s/s", 1, kAcceleration},
      {"m s^-2", 1, kAcceleration},
      {"m s-2", 1, kAcceleration},
      {"m s\u207B\u00B2", 1, kAcceleration},
      {"kg m^2", 1, kInertia},
      {"kg*m2", 1, kInertia},
      {"kg m\u00B2", 1, kInertia},
      {"kg\u00B7m^2", 1, kInertia},
      {"kg mm ^ 2", 1e-6, kInertia},
      {"m2/s2", 1, {2, 0, -2}},
      {"N m", 1, kTorque},
      {"N/rad", 1, kForce},
      {"kN/deg", 1e3 * 180 / kPi, kForce},
      {"Nm/(rad/s)", 1, {2, 1, -1}},
      {"N/(rad s)", 1, {1, 1, -3}},
      {"N/rad s", 1, {1, 1, -1}},
      {"(m/s)^2", 1, {2, 0, -2}},
      {"1/s", 1, kRate},
      {"rad/s", 1, kRate},
      {"deg/s", kPi / 180, kRate},
      {"deg/sec", kPi / 180, kRate},
      {"\u00B0/s", kPi / 180, kRate},
      {"\u00B5s", 1e-6, {0, 0, 1}},
      {"\u03BCs", 1e-6, {0, 0, 1}},
      {"1/min", 1.0 / 60, kRate},
      {"1e8 m^3", 1e8, {3}},
      {"1e8 m^3/s", 1e8, {3, 0, -1}},
      {"10^3 kg", 1e3, {0, 1}},
      {"deg/g", kPi / 180 / 9.80665, {-1, 0, 2}},
  });
}

TEST(Units, CaseIsForgivenWhereItLeavesNoDoubt) {
  expect_units({
      {"KPH", 1 / 3.6, kSpeed},
      {"Kph", 1 / 3.6, kSpeed},
      {"Km/h", 1 / 3.6, kSpeed},
      {"KM/H", 1 / 3.6, kSpeed},
      {"DEG", kPi / 180, kNumber},
      {"DEG/SEC", kPi / 180, kRate},
      {"SEC", 1, {0, 0, 1}},
      {"G", 9.80665, kAcceleration},
      {"RPM", 2 * kPi / 60, kRate},
      {"hz", 1, kRate},
      {"KG", 1, {0, 1}},
  });
  // Kilonewton or knot, newton metre or nanometre: not ours to choose.
  EXPECT_FALSE(parse_unit("KN"));
  EXPECT_FALSE(parse_unit("NM"));
  // Small letters are names of quantities, not of units in the wrong case.
  EXPECT_FALSE(parse_unit("n"));
  EXPECT_FALSE(parse_unit("v"));
  EXPECT_FALSE(parse_unit("a"));
}

TEST(Units, TemperatureOffsetCountsOnlyAlone) {
  const std::optional<Unit> celsius = parse_unit("degC");
  ASSERT_TRUE(celsius);
  EXPECT_DOUBLE_EQ(celsius->to_si(20.0), 293.15);
  EXPECT_DOUBLE_EQ(celsius->from_si(293.15), 20.0);
  EXPECT_EQ(parse_unit("\u00B0C")->offset, 273.15);
  EXPECT_NEAR(parse_unit("\u00B0F")->to_si(212.0), 373.15, 1e-10);
  for (const char* text : {"degC/s", "1/degC", "W/degC", "degC^2"}) {
    SCOPED_TRACE(text);
    ASSERT_TRUE(parse_unit(text));
    EXPECT_EQ(parse_unit(text)->offset, 0.0);
    EXPECT_EQ(parse_unit(text)->scale, 1.0);
  }
}

TEST(Units, ConversionGoesThereAndBack) {
  const Unit unit = *parse_unit("km/h");
  EXPECT_DOUBLE_EQ(unit.to_si(60.0), 60.0 / 3.6);
  EXPECT_DOUBLE_EQ(unit.from_si(unit.to_si(60.0)), 60.0);
}

TEST(Units, AnythingElseIsNoUnit) {
  for (const char* text : {"xyz",          "rps",
                           "yaw_rate_rps", "m/",
                           "/s",           "m//s",
                           "*m",           "m**",
                           "m^",           "m^x",
                           "m^1.5.5",      "m^99",
                           "(m",           "m)",
                           "()",           "0",
                           "-1",           "1e999",
                           "m+s",          "--",
                           "m\xFF",        "km/h)",
                           "(((((((((m",   "[m]",
                           "m^20^20",      "((((m^20)^20)^20)^20)^20",
                           "(km^20)^20"}) {
    SCOPED_TRACE(text);
    EXPECT_FALSE(parse_unit(text));
  }
  EXPECT_FALSE(parse_unit(std::string(200, 'm')));
  EXPECT_FALSE(parse_unit(std::string(99, '(')));
}

TEST(Units, NumbersInWhatIsNoUnitStayAsTheyAre) {
  EXPECT_EQ(unit_or_dimensionless("km/h").scale, parse_unit("km/h")->scale);
  EXPECT_EQ(unit_or_dimensionless("degC").to_si(1.0), 274.15);
  const Unit unit = unit_or_dimensionless("counts of the converter");
  EXPECT_EQ(unit.to_si(3.7), 3.7);
  EXPECT_EQ(unit.from_si(3.7), 3.7);
  EXPECT_TRUE(same_dimension(unit, *parse_unit("")));
}

TEST(Units, NearestUnitHelpsWithTypingMistakes) {
  EXPECT_EQ(nearest_unit("degr"), "deg");
  EXPECT_EQ(nearest_unit("km/hh"), "km/h");
  EXPECT_EQ(nearest_unit("rad/sc"), "rad/s");
  EXPECT_EQ(nearest_unit("quite something else"), "");
}

TEST(Units, AnglesAreDimensionless) {
  EXPECT_TRUE(same_dimension(*parse_unit("N/rad"), *parse_unit("kN/deg")));
  EXPECT_TRUE(same_dimension(*parse_unit("N/rad"), *parse_unit("N")));
  EXPECT_TRUE(same_dimension(*parse_unit("1/s"), *parse_unit("rpm")));
  EXPECT_TRUE(same_dimension(*parse_unit("Nm"), *parse_unit("J")));
  EXPECT_FALSE(same_dimension(*parse_unit("deg"), *parse_unit("deg/s")));
  EXPECT_FALSE(same_dimension(*parse_unit("g"), *parse_unit("kg")));
}

}  // namespace
}  // namespace identikal
