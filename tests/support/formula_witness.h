// The value of a formula by walking its tree in extended precision, and derivatives by differences.
#pragma once

#include <cmath>
#include <vector>

#include "lib/formula/expression.h"

namespace identikal {

using Extended = long double;

inline Extended walk(const Expression& formula, int at, const std::vector<Extended>& symbols) {
  const Expression::Node& node = formula.nodes[static_cast<std::size_t>(at)];
  const auto a = [&] { return walk(formula, node.a, symbols); };
  const auto b = [&] { return walk(formula, node.b, symbols); };
  switch (node.op) {
    case Op::number:
      return node.value;
    case Op::symbol:
      return symbols[static_cast<std::size_t>(node.symbol)];
    case Op::add:
      return a() + b();
    case Op::subtract:
      return a() - b();
    case Op::multiply:
      return a() * b();
    case Op::divide:
      return a() / b();
    case Op::negate:
      return -a();
    case Op::reciprocal:
      return 1 / a();
    case Op::power:
      return std::pow(a(), b());
    case Op::less:
      return a() < b();
    case Op::less_equal:
      return a() <= b();
    case Op::greater:
      return a() > b();
    case Op::greater_equal:
      return a() >= b();
    case Op::equal:
      return a() == b();
    case Op::not_equal:
      return a() != b();
    case Op::logical_and:
      return a() != 0 && b() != 0;
    case Op::logical_or:
      return a() != 0 || b() != 0;
    case Op::logical_not:
      return a() == 0;
    case Op::choose:
      return a() != 0 ? b() : walk(formula, node.c, symbols);
    case Op::sin:
      return std::sin(a());
    case Op::cos:
      return std::cos(a());
    case Op::tan:
      return std::tan(a());
    case Op::asin:
      return std::asin(a());
    case Op::acos:
      return std::acos(a());
    case Op::atan:
      return std::atan(a());
    case Op::atan2:
      return std::atan2(a(), b());
    case Op::sinh:
      return std::sinh(a());
    case Op::cosh:
      return std::cosh(a());
    case Op::tanh:
      return std::tanh(a());
    case Op::exp:
      return std::exp(a());
    case Op::log:
      return std::log(a());
    case Op::log10:
      return std::log10(a());
    case Op::sqrt:
      return std::sqrt(a());
    case Op::abs:
      return std::fabs(a());
    case Op::sign:
      return a() > 0 ? 1 : a() < 0 ? -1 : 0;
    case Op::floor:
      return std::floor(a());
    case Op::min:
      return std::min(a(), b());
    case Op::max:
      return std::max(a(), b());
    case Op::hypot:
      return std::hypot(a(), b());
  }
  return NAN;
}

inline Extended walk(const Expression& formula, const std::vector<Extended>& symbols) {
  return walk(formula, static_cast<int>(formula.nodes.size()) - 1, symbols);
}

/// Central differences with steps h and h/2, extrapolated: errs by h^4.
inline Extended difference(const Expression& formula, std::vector<Extended> symbols, int by,
                           Extended h = 1e-3L) {
  const auto slope = [&](Extended step) {
    std::vector<Extended> up = symbols, down = symbols;
    up[static_cast<std::size_t>(by)] += step;
    down[static_cast<std::size_t>(by)] -= step;
    return (walk(formula, up) - walk(formula, down)) / (2 * step);
  };
  return (4 * slope(h / 2) - slope(h)) / 3;
}

}  // namespace identikal
