// Curves and tables of model files: what their formulas are worth, and what is refused.
#include "identify/model/curves.h"

#include <cmath>
#include <map>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "identify/model/model_file.h"
#include "lib/base/error.h"
#include "lib/formula/expression.h"

namespace identikal {
namespace {

// The written-out curve f of x (and y), with these values in the order of its parameters.
class WrittenCurve {
 public:
  explicit WrittenCurve(const std::string& curve)
      : root_(with_curves(parse_yaml("let: {f: " + curve + "}", "curve.yaml"))) {
    names_ = {"x", "y"};
    for (const YamlNode& name : find(root_, "parameters")->keys) names_.push_back(name.text);
    formula_ = parse_expression(find(*find(root_, "let"), "f")->text, names_);
  }
  const std::vector<std::string>& names() const { return names_; }
  // What the file says of a parameter.
  double value(const std::string& name) const {
    return std::stod(find(*find(*find(root_, "parameters"), name), "value")->text);
  }
  template <typename ValueOf>
  double operator()(double x, double y, const ValueOf& value_of) const {
    std::vector<double> symbols{x, y};
    for (std::size_t i = 2; i < names_.size(); ++i) {
      const bool distance = names_[i].find("distance") != std::string::npos;
      symbols.push_back(distance ? value(names_[i]) : value_of(i - 2));
    }
    return evaluate(formula_, symbols);
  }

 private:
  YamlNode root_;
  std::vector<std::string> names_;
  Expression formula_;
};

TEST(Curves, ASplineIsEveryCubicBetweenItsKnotsAndStraightOutside) {
  const std::vector<double> knots{-0.3, -0.1, 0.0, 0.25, 0.3, 0.6};
  const WrittenCurve curve("{spline: x, knots: [-0.3, -0.1, 0, 0.25, 0.3, 0.6]}");
  const auto cubic = [](double x) { return 1.0 - 2.0 * x + 30.0 * x * x - 40.0 * x * x * x; };
  const auto slope = [](double x) { return -2.0 + 60.0 * x - 120.0 * x * x; };
  const auto at = [&](double x) {
    return curve(x, 0.0, [&](std::size_t i) { return cubic(knots[i]); });
  };
  for (double x = -0.3; x <= 0.6; x += 0.013) EXPECT_NEAR(at(x), cubic(x), 1e-11) << x;
  EXPECT_NEAR(at(-1.3), cubic(-0.3) - slope(-0.3), 1e-10);
  EXPECT_NEAR(at(1.6), cubic(0.6) + slope(0.6), 1e-10);
  EXPECT_EQ(curve.names()[2], "f_1");
  EXPECT_EQ(curve.names().back(), "f_distance");
  EXPECT_NEAR(curve.value("f_distance"), 0.18, 1e-15);
}

TEST(Curves, ASplineGoesThroughItsValuesWithTwoContinuousDerivatives) {
  const WrittenCurve curve("{spline: x + y, knots: [0, 1, 2, 3, 4, 5, 6]}");
  const std::vector<double> values{1, -2, 0.5, 3, 3, -1, 2};
  const auto at = [&](double x) {
    return curve(x - 1.0, 1.0, [&](std::size_t i) { return values[i]; });
  };
  for (std::size_t i = 0; i < values.size(); ++i)
    EXPECT_NEAR(at(static_cast<double>(i)), values[i], 1e-11);
  for (const double knot : {1.0, 2.0, 3.0, 4.0, 5.0}) {
    const double h = 1e-4;
    const auto second = [&](double x) { return (at(x + h) - 2.0 * at(x) + at(x - h)) / (h * h); };
    EXPECT_NEAR(second(knot - 2 * h), second(knot + 2 * h), 0.05) << knot;
  }
}

TEST(Curves, ATableIsStraightBetweenItsKnots) {
  const WrittenCurve line("{table: x, knots: [0, 1, 3], values: [1, 2, -2]}");
  const std::vector<double> values{1, 2, -2};
  const auto at = [&](double x) { return line(x, 0.0, [&](std::size_t i) { return values[i]; }); };
  for (const auto& [x, y] : {std::pair{-1.0, 0.0},
                             {0.0, 1.0},
                             {0.5, 1.5},
                             {1.0, 2.0},
                             {2.0, 0.0},
                             {3.0, -2.0},
                             {4.0, -4.0}})
    EXPECT_NEAR(at(x), y, 1e-14) << x;
  EXPECT_EQ(line.value("f_3"), -2.0);

  const WrittenCurve plane("{table: [x, y], knots: [[0, 1, 3], [0, 10]]}");
  EXPECT_EQ(plane.names()[3], "f_1_2");
  // Linear in each of both: a product of both is such a table.
  const auto product = [](double x, double y) { return (1.0 + x) * (2.0 - 0.1 * y); };
  const std::vector<double> xs{0, 1, 3}, ys{0, 10};
  for (const double x : {-1.0, 0.3, 1.0, 2.5, 4.0}) {
    for (const double y : {-5.0, 0.0, 7.0, 12.0}) {
      const double value =
          plane(x, y, [&](std::size_t i) { return product(xs[i / 2], ys[i % 2]); });
      EXPECT_NEAR(value, product(x, y), 1e-12);
    }
  }
}

const std::string kModel =
    "identikal: 1\nstates: {x: m}\ninputs: [{name: u, unit: V}]\ntime: {kind: discrete, step: 1 "
    "s}\n"
    "parameters: {a: {value: 0.5}, f_2: {value: 3 N, min: 0 N}, b: {value: 1 m/N, fixed: true}}\n"
    "dynamics: {x: a*x + b*f}\noutputs: {y: {column: y, unit: m, equals: x}}\n"
    "noise: {measurement: {sd: {y: 0.1 m}}}\ninitial: {mean: {x: 0}}\n";

TEST(Curves, HaveTheUnitsOfTheModelAndWhatTheFileSaysOfThem) {
  const Model model = parse_model_file(
      kModel + "let: {f: {spline: u, knots: [-100 mV, 0 mV, 100 mV], unit: N}}\n", "m.yaml");
  const auto named = [&](const std::string& name) {
    for (const Parameter& each : model.parameters) {
      if (each.name == name) return each;
    }
    ADD_FAILURE() << name;
    return Parameter{};
  };
  EXPECT_EQ(named("f_2").scalar(), 3.0);
  EXPECT_EQ(named("f_2").min, 0.0);
  EXPECT_EQ(named("f_1").unit, "N");
  EXPECT_NEAR(named("f_distance").scalar(), 0.1, 1e-15);
  EXPECT_TRUE(named("f_distance").fixed);
}

// What carries a unit keeps it; 'unit' is that of plain numbers.
TEST(Curves, TakeValuesWithTheirUnits) {
  const Model model = parse_model_file(
      kModel + "let: {f: {spline: u, knots: [0 V, 1 V, 2 V], unit: N, values: [2 kN, 1 N, 5]}}\n",
      "m.yaml");
  std::map<std::string, Parameter> named;
  for (const Parameter& each : model.parameters) named[each.name] = each;
  EXPECT_EQ(named["f_1"].scalar(), 2000.0);
  EXPECT_EQ(named["f_1"].unit, "kN");
  EXPECT_EQ(named["f_3"].scalar(), 5.0);
  EXPECT_EQ(named["f_3"].unit, "N");
}

std::string curve_refusal(const std::string& curve) {
  try {
    parse_model_file(kModel + "let: {f: " + curve + "}\n", "m.yaml");
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(Curves, RefuseWhatIsNone) {
  EXPECT_EQ(curve_refusal("{spline: u, knots: [0, 1]}"),
            "m.yaml:10:29: the knots of curve 'f'; expected a list of 3 to 14 rising numbers: [-1, "
            "0, 1]");
  EXPECT_EQ(curve_refusal("{spline: u, knots: [0, 1, 1]}"),
            "m.yaml:10:36: knot 1 behind 1; expected knots that rise");
  EXPECT_EQ(curve_refusal("{spline: u, knots: [0 V, 1 mV, 2 V]}"),
            "m.yaml:10:35: a knot in 'mV' behind one in 'V'; expected all knots in one unit");
  EXPECT_NE(curve_refusal("{knots: [0, 1, 2]}").find("without 'spline' or 'table'"),
            std::string::npos);
  EXPECT_NE(curve_refusal("{spline: u}").find("'knots'"), std::string::npos);
  EXPECT_NE(
      curve_refusal("{spline: u, knots: [0 V, 1 V, 2 V], value: [1]}").find("unknown key 'value'"),
      std::string::npos);
  EXPECT_NE(curve_refusal("{spline: u, knots: [0 V, 1 V, 2 V], values: [1]}").find("a list of 3"),
            std::string::npos);
  EXPECT_NE(curve_refusal("{table: [u], knots: [[0 V, 1 V]]}").find("over 1 formulas"),
            std::string::npos);
  EXPECT_NE(curve_refusal("{spline: u, knots: [0 m, 1 m, 2 m], unit: N}"), "");  // u is a voltage
}

}  // namespace
}  // namespace identikal
