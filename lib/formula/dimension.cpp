#include "lib/formula/dimension.h"

#include <cmath>
#include <cstdio>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

namespace identikal {
namespace {

struct NamedDimension {
  std::string_view name;
  Exponents exponent;
};
constexpr NamedDimension kDimensions[] = {
    {"a number", {}},
    {"a length", {1}},
    {"an area", {2}},
    {"a volume", {3}},
    {"a mass", {0, 1}},
    {"a time", {0, 0, 1}},
    {"a current", {0, 0, 0, 1}},
    {"a temperature", {0, 0, 0, 0, 1}},
    {"a rate", {0, 0, -1}},
    {"a speed", {1, 0, -1}},
    {"an acceleration", {1, 0, -2}},
    {"a force", {1, 1, -2}},
    {"an energy or a torque", {2, 1, -2}},
    {"a power", {2, 1, -3}},
    {"a voltage", {2, 1, -3, -1}},
    {"a resistance", {2, 1, -3, -2}},
    {"a capacitance", {-2, -1, 4, 2}},
    {"a charge", {0, 0, 1, 1}},
    {"a pressure", {-1, 1, -2}},
    {"a moment of inertia", {2, 1}},
    {"a stiffness", {0, 1, -2}},
    {"a flow", {3, 0, -1}},
    {"a density", {-3, 1}},
    {"an amount of substance", {0, 0, 0, 0, 0, 1}},
    {"a concentration", {-3, 0, 0, 0, 0, 1}},
};

// Fractions such as 1/3 are rounded; powers that a formula can mean are far coarser.
constexpr double kSameExponent = 1e-9;
constexpr double kLargestExponent = 1000.0;

bool same_exponents(const Exponents& a, const Exponents& b) {
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (!(std::abs(a[i] - b[i]) <= kSameExponent)) return false;
  }
  return true;
}

// "kg m^2/(s^3 A)"
std::string si_product(const Exponents& exponent) {
  constexpr std::pair<std::size_t, std::string_view> kOrder[] = {{1, "kg"}, {0, "m"}, {2, "s"},
                                                                 {3, "A"},  {4, "K"}, {5, "mol"}};
  std::string above, below;
  int factors_below = 0;
  for (const auto& [index, name] : kOrder) {
    const double power = std::abs(exponent[index]);
    if (power <= kSameExponent) continue;
    std::string& side = exponent[index] > 0.0 ? above : below;
    if (!side.empty()) side += ' ';
    side += name;
    if (std::abs(power - 1.0) > kSameExponent) {
      char text[32];
      std::snprintf(text, sizeof text, "^%.4g", power);
      side += text;
    }
    if (&side == &below) ++factors_below;
  }
  if (below.empty()) return above.empty() ? "no dimension" : above;
  if (factors_below > 1) below = "(" + below + ")";
  return (above.empty() ? "1" : above) + "/" + below;
}

/// Of a node: its dimension, and its value where it holds no symbol.
struct Measure {
  Dimension dimension;
  std::optional<double> value;
};

class DimensionCheck {
 public:
  DimensionCheck(const Expression& expression, std::span<const Dimension> symbols)
      : expression_(expression), symbols_(symbols) {}

  Dimension run() {
    measures_.reserve(expression_.nodes.size());
    for (const Expression::Node& node : expression_.nodes) {
      node_ = &node;
      measures_.push_back(measure(node));
    }
    return measures_.back().dimension;
  }

 private:
  const Measure& operand(int node) const { return measures_[node]; }

  Measure measure(const Expression::Node& node) const {
    if (node.op == Op::number) {
      Dimension out;
      if (node.gravity) out.exponent = {1, 0, -2};
      out.plain = !node.gravity;
      return {out, node.value};
    }
    if (node.op == Op::symbol) {
      return {symbols_[node.symbol], std::nullopt};
    }
    Measure out;
    out.dimension = dimension(node);
    bool constant = true;
    double value[3]{};
    const int inputs[] = {node.a, node.b, node.c};
    for (std::size_t i = 0; i < 3; ++i) {
      if (inputs[i] < 0) continue;
      constant = constant && operand(inputs[i]).value.has_value();
      value[i] = operand(inputs[i]).value.value_or(0.0);
    }
    if (constant) out.value = apply(node.op, value[0], value[1], value[2]);
    return out;
  }

  Dimension dimension(const Expression::Node& node) const {
    switch (node.op) {
      case Op::number:
      case Op::symbol:
        return {};
      case Op::negate:
      case Op::abs:
        return operand(node.a).dimension;
      case Op::add:
      case Op::subtract:
        return of_sum(node);
      case Op::multiply:
        return of_product(node, 1.0);
      case Op::divide:
        return of_product(node, -1.0);
      case Op::reciprocal:
        return of_power(node.a, -1.0);
      case Op::power:
        return of_power(node);
      case Op::sqrt:
        return of_power(node.a, 0.5);
      case Op::min:
      case Op::max:
      case Op::hypot:
        return common(node.a, node.b);
      case Op::choose:
        return common(node.b, node.c);
      case Op::less:
      case Op::less_equal:
      case Op::greater:
      case Op::greater_equal:
      case Op::equal:
      case Op::not_equal:
      case Op::atan2:
        common(node.a, node.b);
        return {};
      case Op::logical_and:
      case Op::logical_or:
      case Op::logical_not:
      case Op::sign:
        return {};
      default:
        return of_function(node);
    }
  }

  [[noreturn]] void disagree(const Dimension& a, const Dimension& b,
                             const std::string& hint = "") const {
    const std::string with = node_->op == Op::choose
                                 ? "'if' chooses between "
                                 : "'" + std::string(spelling(node_->op)) + "' between ";
    throw FormulaError(node_->column, with + in_words(a) + " and " + in_words(b),
                       "the same dimension on both sides", hint);
  }

  Dimension common(int a, int b) const {
    const Dimension& left = operand(a).dimension;
    const Dimension& right = operand(b).dimension;
    if (!fits(left, right)) disagree(left, right);
    return left.plain ? right : left;
  }

  Dimension of_sum(const Expression::Node& node) const {
    const Measure& left = operand(node.a);
    const Measure& right = operand(node.b);
    if (same_exponents(left.dimension.exponent, right.dimension.exponent)) {
      return left.dimension.plain ? right.dimension : left.dimension;
    }
    if (left.dimension.plain && left.value == 0.0) return right.dimension;
    if (right.dimension.plain && right.value == 0.0) return left.dimension;
    const bool number = left.dimension.plain || right.dimension.plain;
    disagree(left.dimension, right.dimension,
             number ? "declare the number as a parameter with its unit" : "");
  }

  Dimension of_product(const Expression::Node& node, double sign) const {
    const Dimension& left = operand(node.a).dimension;
    const Dimension& right = operand(node.b).dimension;
    Dimension out;
    for (std::size_t i = 0; i < out.exponent.size(); ++i) {
      out.exponent[i] = left.exponent[i] + sign * right.exponent[i];
    }
    out.plain = left.plain && right.plain;
    return sane(out);
  }

  Dimension of_power(int base, double exponent) const {
    Dimension out = operand(base).dimension;
    for (double& e : out.exponent) e *= exponent;
    return sane(out);
  }

  Dimension of_power(const Expression::Node& node) const {
    const Measure& base = operand(node.a);
    const Measure& exponent = operand(node.b);
    if (!same_exponents(exponent.dimension.exponent, {})) {
      throw FormulaError(
          node.column, "'^' with an exponent that is " + in_words(exponent.dimension), "a number");
    }
    if (!same_exponents(base.dimension.exponent, {})) {
      if (!exponent.value) {
        throw FormulaError(
            node.column,
            "'^' of " + in_words(base.dimension) + " with an exponent that is not constant",
            "a number as the exponent, or a base without dimension",
            "divide the base by a quantity of its dimension");
      }
      return of_power(node.a, *exponent.value);
    }
    Dimension out;
    out.plain = base.dimension.plain && exponent.dimension.plain;
    return out;
  }

  Dimension of_function(const Expression::Node& node) const {
    const Dimension& argument = operand(node.a).dimension;
    if (!same_exponents(argument.exponent, {})) {
      throw FormulaError(node.column,
                         "'" + std::string(spelling(node.op)) + "' of " + in_words(argument),
                         "a number or an angle", "divide by a quantity of the same dimension");
    }
    return argument;
  }

  // Products can only grow so far: what they count beyond that is no dimension.
  Dimension sane(const Dimension& out) const {
    for (const double e : out.exponent) {
      if (std::abs(e) <= kLargestExponent) continue;
      throw FormulaError(node_->column, "a dimension with a power beyond 1000");
    }
    return out;
  }

  const Expression& expression_;
  std::span<const Dimension> symbols_;
  std::vector<Measure> measures_;
  const Expression::Node* node_ = nullptr;
};

}  // namespace

Dimension dimension_of(const Unit& unit) {
  Dimension out;
  for (std::size_t i = 0; i < out.exponent.size(); ++i) out.exponent[i] = unit.dimension[i];
  return out;
}

bool fits(const Dimension& a, const Dimension& b) {
  return a.plain || b.plain || same_exponents(a.exponent, b.exponent);
}

std::string in_words(const Dimension& dimension) {
  const std::string product = si_product(dimension.exponent);
  for (const NamedDimension& known : kDimensions) {
    if (same_exponents(known.exponent, dimension.exponent)) {
      return std::string(known.name) + " (" + product + ")";
    }
  }
  return product;
}

Dimension dimension_of(const Expression& expression, std::span<const Dimension> symbols) {
  return DimensionCheck(expression, symbols).run();
}

void check_dimension(const Expression& expression, std::span<const Dimension> symbols,
                     const Dimension& wanted, const std::string& what) {
  const Dimension found = dimension_of(expression, symbols);
  if (fits(found, wanted)) return;
  throw FormulaError(expression.nodes.back().column, "the formula is " + in_words(found),
                     in_words(wanted) + ", as " + what + " is");
}

}  // namespace identikal
