#include "lib/formula/tape.h"

#include <array>
#include <cmath>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "lib/base/random.h"
#include "lib/formula/tape_code.h"
#include "tests/support/formula_witness.h"

namespace identikal {
namespace {

const std::vector<std::string> kTapeNames{"x", "y", "z", "p", "q"};
const std::vector<bool> kTapeHeld{false, false, false, true, true};
const std::vector<int> kAllSymbols{0, 1, 2, 3, 4};

struct ValuesAndSlopes {
  std::vector<double> f, J;
};
ValuesAndSlopes run_tape(const std::vector<Expression>& formulas, const std::vector<double>& at) {
  const Tape tape = compile(formulas, kTapeHeld, kAllSymbols);
  TapeMemory memory = make_memory(tape);
  std::copy(at.begin(), at.end(), memory.begin());
  evaluate_held(tape, memory);
  ValuesAndSlopes out{std::vector<double>(formulas.size()),
                      std::vector<double>(formulas.size() * kAllSymbols.size())};
  std::vector<double> alone(formulas.size());
  evaluate_values(tape, memory, alone);
  evaluate_jacobian(tape, memory, out.f, out.J);
  EXPECT_EQ(alone, out.f);
  return out;
}
ValuesAndSlopes run_tape(const std::string& text, const std::vector<double>& at) {
  return run_tape({parse_expression(text, kTapeNames)}, at);
}

void expect_like_the_tree(const std::string& text, const std::vector<double>& at) {
  SCOPED_TRACE(text);
  const Expression formula = parse_expression(text, kTapeNames);
  const std::vector<Extended> point(at.begin(), at.end());
  const ValuesAndSlopes tape = run_tape(text, at);
  const auto value = static_cast<double>(walk(formula, point));
  EXPECT_NEAR(tape.f[0], value, 1e-13 * (1.0 + std::abs(value)));
  for (const int by : kAllSymbols) {
    const auto slope = static_cast<double>(difference(formula, point, by));
    EXPECT_NEAR(tape.J[static_cast<std::size_t>(by)], slope, 1e-9 * (1.0 + std::abs(slope))) << by;
  }
}

TEST(Tape, EveryOperationAndItsDerivative) {
  const std::vector<double> at{0.3, 0.7, 1.9, 2.3, 0.6};
  for (const char* text : {"x + y",
                           "x - p*y",
                           "p - x",
                           "x*y*z",
                           "x/y",
                           "p/q/x",
                           "-x",
                           "-(p + q)/(p*z)*x",
                           "x^2",
                           "x^-3",
                           "x^8",
                           "x^9",
                           "x^2.5",
                           "x^y",
                           "2^x",
                           "sqrt(x)",
                           "x^0.5",
                           "sin(x*p)",
                           "cos(x*p)",
                           "tan(x*q)",
                           "asin(x*q)",
                           "acos(x*q)",
                           "atan(x*p)",
                           "atan2(x, y)",
                           "atan2(-x, p)",
                           "sinh(x)",
                           "cosh(x*y)",
                           "tanh(p*x)",
                           "exp(-x/y)",
                           "log(x + p)",
                           "log10(z)",
                           "abs(x - y)",
                           "sign(x)*y",
                           "floor(z)*x",
                           "min(x, y)",
                           "max(x*p, y, z)",
                           "hypot(x, y)",
                           "hypot(x, p)*q",
                           "if(x < y, x*z, y*z)",
                           "if(x > y and p > 1 or not q == 3, sin(z), z)",
                           "if(x >= y, 1, 0)*z + if(p <= q, x, y)",
                           "x*x - 2*x*y + y*y",
                           "x - (y - (z - (p - x)))",
                           "x*y + z*p - q*x - y*p + z",
                           "1/(1 + exp(-p*(x - q)))",
                           "p*sin(q*atan(z*x - y*(z*x - atan(z*x))))",
                           "(x + y)*(x + y)/(x + y)",
                           "-x*-y*-p",
                           "0*x + 1*y",
                           "p*q + p/q - q^p"}) {
    expect_like_the_tree(text, at);
  }
}

// A formula of random operations; everything stays away from kinks and poles by construction.
std::string random_formula(Random& random, int depth) {
  const auto pick = [&](int count) { return static_cast<int>(random.uniform() * count); };
  if (depth == 0) return pick(4) == 0 ? "1.25" : kTapeNames[static_cast<std::size_t>(pick(5))];
  const auto a = [&] { return "(" + random_formula(random, depth - 1) + ")"; };
  switch (pick(12)) {
    case 0:
      return a() + "+" + a();
    case 1:
      return a() + "-" + a();
    case 2:
    case 3:
      return a() + "*" + a();
    case 4:
      return a() + "/(2 + " + a() + "^2)";
    case 5:
      return "-" + a();
    case 6:
      return "sin" + a();
    case 7:
      return "tanh" + a();
    case 8:
      return "sqrt(1.5 + " + a() + "^2)";
    case 9:
      return "exp(-" + a() + "^2)";
    case 10:
      return "atan2(" + a() + ", 3 + " + a() + "^2)";
    default:
      return "if(p > 2, " + a() + ", " + a() + ")";
  }
}

TEST(Tape, RandomFormulasAgreeWithTheTree) {
  Random random(7);
  for (int i = 0; i < 400; ++i) {
    std::vector<double> at(5);
    for (double& x : at) x = 0.4 + 0.9 * random.uniform() + (random.uniform() < 0.3 ? 1.0 : 0.0);
    const std::string text = random_formula(random, 1 + i % 5);
    SCOPED_TRACE(text);
    const Expression formula = parse_expression(text, kTapeNames);
    const std::vector<Extended> point(at.begin(), at.end());
    const ValuesAndSlopes tape = run_tape(text, at);
    const auto value = static_cast<double>(walk(formula, point));
    EXPECT_NEAR(tape.f[0], value, 1e-10 * (1.0 + std::abs(value)));
    for (const int by : kAllSymbols) {
      const auto slope = static_cast<double>(difference(formula, point, by, 1e-5L));
      EXPECT_NEAR(tape.J[static_cast<std::size_t>(by)], slope, 1e-7 * (1.0 + std::abs(slope)))
          << by;
    }
  }
}

TEST(Tape, TheSideNotTakenPoisonsNothing) {
  // At x = 0 and below: the square root, its slope and the logarithm are not finite.
  for (const double x : {0.0, -1.0}) {
    const std::vector<double> at{x, 2.0, 3.0, 4.0, 5.0};
    for (const char* text :
         {"if(x > 0, sqrt(x), y*x)", "y*if(x > 0, log(x)*p, x)", "if(x > 0, x^1.5, 0) + y*x",
          "exp(if(x > 0, 1/x, y)*if(y > 1, x, 1/x))", "if(y > 1, if(x > 0, q*log(x), x), sqrt(x))",
          "min(sqrt(y), 1)*x", "max(if(x > 0, 1/x, x), -9)*q"}) {
      SCOPED_TRACE(text);
      const ValuesAndSlopes tape = run_tape(text, at);
      EXPECT_TRUE(std::isfinite(tape.f[0]));
      for (const double slope : tape.J) EXPECT_TRUE(std::isfinite(slope));
    }
  }
  EXPECT_EQ(run_tape("if(x > 0, sqrt(x), y*x)", {0.0, 2.0, 0.0, 0.0, 0.0}).J[0], 2.0);
  EXPECT_EQ(run_tape("hypot(x, y) + abs(x)", {0.0, 0.0, 0.0, 0.0, 0.0}).J[0], 0.0);
  EXPECT_EQ(run_tape("x^y", {0.0, 2.0, 0.0, 0.0, 0.0}).J[1], 0.0);
}

TEST(Tape, CommonPartsAndHeldPartsAreComputedOnce) {
  const std::vector<Expression> formulas{parse_expression("sin(x*y) + p*q", kTapeNames),
                                         parse_expression("z*sin(y*x) - exp(p)*x", kTapeNames)};
  const Tape tape = compile(formulas, kTapeHeld);
  EXPECT_EQ(tape.code.size() - tape.held_end, 4U);  // x*y, sin, two sums
  const Tape folded =
      compile(std::vector{parse_expression("2*pi*3 + 4^2*0", kTapeNames)}, kTapeHeld);
  EXPECT_EQ(folded.code.size(), 0U);
}

TEST(Tape, LongSumsAndDoublingDefinitionsStaySmall) {
  std::string sum = "x";
  for (int i = 0; i < 1500; ++i) sum += i % 2 == 0 ? "-p*x" : "+y*z";
  const ValuesAndSlopes tape = run_tape(sum, {0.5, 2.0, 3.0, 0.25, 0.0});
  EXPECT_NEAR(tape.f[0], 0.5 - 750 * 0.125 + 750 * 6.0, 1e-9);
  EXPECT_NEAR(tape.J[0], 1.0 - 750 * 0.25, 1e-10);
  // Each definition uses the one before twice: as a tree, 2^60 nodes.
  FormulaGraph graph({false});
  std::vector<std::string> names{"x"};
  std::vector<FormulaGraph::Id> nodes{graph.symbol(0)};
  for (int i = 0; i < 60; ++i) {
    nodes.push_back(graph.insert(
        parse_expression("sin(" + names.back() + ")*cos(" + names.back() + ")", names), nodes));
    names.push_back("d" + std::to_string(i));
  }
  const std::array<int, 1> by{0};
  graph.gradient(nodes.back(), by);
  EXPECT_LT(graph.size(), 2000U);
}

TEST(Tape, DerivativesThatGrowWithoutBoundAreRefused) {
  FormulaGraph graph(std::vector<bool>(3000, false));
  FormulaGraph::Id chain = graph.symbol(0);
  std::vector<int> by;
  for (int i = 0; i < 3000; ++i) {
    const FormulaGraph::Id next = graph.symbol(i);
    chain = graph.operation(Op::choose, graph.operation(Op::less, chain, next),
                            graph.operation(Op::sin, next), chain);
    by.push_back(i);
  }
  EXPECT_THROW(graph.gradient(chain, by), FormulaError);
}

std::string joined(const std::vector<std::string>& lines) {
  std::string out;
  for (const std::string& line : lines) out += line + "\n";
  return out;
}

// That the code computes what the tape does is seen where it is compiled (export_filter_test.py).
TEST(TapeCode, ReadsAsAPersonWouldWriteIt) {
  const std::vector<Expression> formulas{
      parse_expression("p*sin(x) - y^2/q", kTapeNames),
      parse_expression("if(x < y and not (z > 1), -x, atan2(y, 2))", kTapeNames)};
  const Tape tape = compile(formulas, kTapeHeld, kAllSymbols);
  const TapeCode c = code_of(tape, CodeLanguage::c, {"x[0]", "x[1]", "x[2]", "e.p", "e.q"}, 1);
  EXPECT_EQ(joined(c.statements), "t1 = (x[0] < x[1]) && (!(1.0 < x[2]))\n");
  EXPECT_EQ(joined(c.values),
            "e.p*sin(x[0]) + (x[1]*x[1])*(-(1.0/e.q))\n"
            "t1 ? (-x[0]) : atan2(x[1], 2.0)\n");
  EXPECT_EQ(joined(c.jacobian), "e.p*cos(x[0])\nt1 ? (-1.0) : 0.0\n");
  const TapeCode python =
      code_of(tape, CodeLanguage::python, {"x[0]", "x[1]", "x[2]", "p", "q"}, 0);
  EXPECT_EQ(joined(python.statements),
            "t1 = (-x[0]) if float(bool(x[0] < x[1]) and bool(float(not (1.0 < x[2])))) else "
            "np.arctan2(x[1], 2.0)\n");
  EXPECT_EQ(joined(python.values), "p*np.sin(x[0]) + (x[1]*x[1])*(-(1.0/q))\nt1\n");
  EXPECT_TRUE(python.jacobian.empty());
  EXPECT_THROW(code_of(tape, CodeLanguage::c, {"x"}, 1), std::invalid_argument);
}

TEST(TapeCode, NumbersReadBackAsTheyAre) {
  EXPECT_EQ(number_code(3.0, CodeLanguage::c), "3.0");
  EXPECT_EQ(number_code(-1e300, CodeLanguage::python), "-1e+300");
  EXPECT_EQ(number_code(0.1, CodeLanguage::c), "0.1");
  EXPECT_EQ(number_code(-INFINITY, CodeLanguage::c), "-INFINITY");
  EXPECT_EQ(number_code(NAN, CodeLanguage::python), "np.nan");
}

}  // namespace
}  // namespace identikal
