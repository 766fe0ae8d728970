#include "lib/formula/formula_graph.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <map>
#include <numbers>
#include <numeric>
#include <set>
#include <utility>

namespace identikal {
namespace {

constexpr std::size_t kMaxNodes = 200'000;
constexpr std::size_t kMaxWork = 2'000'000;
constexpr double kLargestPower = 8.0;  // that is written as products

[[noreturn]] void refuse_size() {
  throw FormulaError(0, "the formulas and their derivatives are too large",
                     "at most 200 000 operations");
}

bool is_condition(Op op) { return op >= Op::less && op <= Op::logical_not; }

}  // namespace

std::size_t FormulaGraph::KeyHash::operator()(const Key& key) const {
  std::uint64_t hash = key.value + static_cast<std::uint64_t>(key.op);
  for (const Id id : {key.a, key.b, key.c}) {
    hash = (hash ^ (hash >> 29)) * 0x9E3779B97F4A7C15ULL + static_cast<std::uint32_t>(id);
  }
  return static_cast<std::size_t>(hash ^ (hash >> 32));
}

FormulaGraph::FormulaGraph(std::vector<bool> held) : held_(std::move(held)) {}

FormulaGraph::Id FormulaGraph::intern(const Node& node) {
  const std::uint64_t value = node.op == Op::symbol ? static_cast<std::uint64_t>(node.symbol)
                                                    : std::bit_cast<std::uint64_t>(node.value);
  const auto [hit, is_new] =
      known_.try_emplace({node.op, node.a, node.b, node.c, value}, static_cast<Id>(nodes_.size()));
  if (!is_new) return hit->second;
  if (nodes_.size() >= kMaxNodes) refuse_size();
  nodes_.push_back(node);
  Node& out = nodes_.back();
  out.held = node.op != Op::symbol || held_[node.symbol];
  for (const Id operand : {node.a, node.b, node.c}) {
    if (operand >= 0) out.held = out.held && nodes_[operand].held;
  }
  return hit->second;
}

FormulaGraph::Id FormulaGraph::number(double value) {
  Node node;
  // One zero: 0 x is 0 whatever the sign of x.
  node.value = value == 0.0 ? 0.0 : value;
  return intern(node);
}

FormulaGraph::Id FormulaGraph::symbol(int index) {
  Node node;
  node.op = Op::symbol;
  node.symbol = index;
  return intern(node);
}

bool FormulaGraph::is_number(Id id, double value) const {
  return is_number(id) && node(id).value == value;
}

FormulaGraph::Id FormulaGraph::operation(Op op, Id a, Id b, Id c) {
  switch (op) {
    case Op::add:
      return sum(a, b);
    case Op::subtract:
      return difference(a, b);
    case Op::multiply:
      return product(a, b);
    case Op::divide:
      return product(a, reciprocal(b));
    case Op::negate:
      return negated(a);
    case Op::reciprocal:
      return reciprocal(a);
    case Op::power:
      return power(a, b);
    case Op::choose:
      return choice(a, b, c);
    case Op::min:
      return choice(operation(Op::less_equal, a, b), a, b);
    case Op::max:
      return choice(operation(Op::less_equal, b, a), a, b);
    case Op::greater:
      return operation(Op::less, b, a);
    case Op::greater_equal:
      return operation(Op::less_equal, b, a);
    default:
      break;
  }
  const int count = operands(op);
  if (is_number(a) && (count < 2 || is_number(b))) {
    return number(apply(op, node(a).value, count < 2 ? 0.0 : node(b).value));
  }
  Node out;
  out.op = op;
  out.a = a;
  out.b = b;
  return intern(out);
}

FormulaGraph::Id FormulaGraph::sum(Id a, Id b) {
  if (is_number(a) && is_number(b)) return number(node(a).value + node(b).value);
  if (is_number(a, 0.0)) return b;
  if (is_number(b, 0.0)) return a;
  if (node(b).op == Op::negate) return difference(a, node(b).a);
  if (node(a).op == Op::negate) return difference(b, node(a).a);
  Node out;
  out.op = Op::add;
  out.a = std::min(a, b);
  out.b = std::max(a, b);
  return intern(out);
}

FormulaGraph::Id FormulaGraph::difference(Id a, Id b) {
  if (is_number(a) && is_number(b)) return number(node(a).value - node(b).value);
  if (is_number(a, 0.0)) return negated(b);
  if (is_number(b, 0.0)) return a;
  if (node(b).op == Op::negate) return sum(a, node(b).a);
  if (node(a).op == Op::negate) return negated(sum(node(a).a, b));
  const Split parts = split(b);
  if (!node(b).held && !is_number(parts.held, 1.0)) {
    return sum(a, product(negated(parts.held), parts.moving));
  }
  Node out;
  out.op = Op::subtract;
  out.a = a;
  out.b = b;
  return intern(out);
}

FormulaGraph::Split FormulaGraph::split(Id x) {
  const Id one = number(1.0);
  const Node& at = node(x);
  if (at.held) return {x, one};
  if (at.op == Op::multiply && node(at.a).held) return {at.a, at.b};
  if (at.op == Op::multiply && node(at.b).held) return {at.b, at.a};
  return {one, x};
}

FormulaGraph::Id FormulaGraph::product(Id a, Id b) {
  if (is_number(a) && is_number(b)) return number(node(a).value * node(b).value);
  if (is_number(a, 0.0) || is_number(b, 0.0)) return number(0.0);
  if (is_number(a, 1.0)) return b;
  if (is_number(b, 1.0)) return a;
  if (is_number(a, -1.0)) return negated(b);
  if (is_number(b, -1.0)) return negated(a);
  // A sign goes into the held factor where there is one: see negated().
  const bool both_held = node(a).held && node(b).held;
  if (node(a).op == Op::negate && (both_held || !node(a).held)) {
    return negated(product(node(a).a, b));
  }
  if (node(b).op == Op::negate && (both_held || !node(b).held)) {
    return negated(product(a, node(b).a));
  }
  // What is held is gathered in one factor, computed once for many evaluations.
  const Split left = split(a), right = split(b);
  const bool regroup =
      !(node(a).held && node(b).held) && ((left.held != a && !is_number(left.held, 1.0)) ||
                                          (right.held != b && !is_number(right.held, 1.0)));
  if (regroup) {
    return product(product(left.held, right.held), product(left.moving, right.moving));
  }
  Node out;
  out.op = Op::multiply;
  out.a = std::min(a, b);
  out.b = std::max(a, b);
  return intern(out);
}

FormulaGraph::Id FormulaGraph::negated(Id a) {
  const Node at = node(a);
  if (at.op == Op::number) return number(-at.value);
  if (at.op == Op::negate) return at.a;
  if (at.op == Op::subtract) return difference(at.b, at.a);
  if (!at.held && at.op == Op::multiply) {
    const Split parts = split(a);
    if (!is_number(parts.held, 1.0)) return product(negated(parts.held), parts.moving);
  }
  Node out;
  out.op = Op::negate;
  out.a = a;
  return intern(out);
}

FormulaGraph::Id FormulaGraph::reciprocal(Id a) {
  const Node at = node(a);
  if (at.op == Op::number) return number(1.0 / at.value);
  if (at.op == Op::reciprocal) return at.a;
  if (at.op == Op::negate) return negated(reciprocal(at.a));
  if (!at.held && at.op == Op::multiply) {
    const Split parts = split(a);
    if (!is_number(parts.held, 1.0)) {
      return product(reciprocal(parts.held), reciprocal(parts.moving));
    }
  }
  Node out;
  out.op = Op::reciprocal;
  out.a = a;
  return intern(out);
}

FormulaGraph::Id FormulaGraph::power(Id a, Id b) {
  if (is_number(b)) {
    const double exponent = node(b).value;
    if (is_number(a)) return number(std::pow(node(a).value, exponent));
    if (exponent == 0.5) return operation(Op::sqrt, a);
    if (exponent == std::floor(exponent) && std::abs(exponent) <= kLargestPower) {
      Id out = number(1.0), square = a;
      for (int left = static_cast<int>(std::abs(exponent)); left > 0; left /= 2) {
        if (left % 2 == 1) out = product(out, square);
        if (left > 1) square = product(square, square);
      }
      return exponent < 0.0 ? reciprocal(out) : out;
    }
  }
  Node out;
  out.op = Op::power;
  out.a = a;
  out.b = b;
  return intern(out);
}

FormulaGraph::Id FormulaGraph::choice(Id condition, Id a, Id b) {
  if (a == b) return a;
  if (is_number(condition)) return node(condition).value != 0.0 ? a : b;
  Node out;
  out.op = Op::choose;
  out.a = condition;
  out.b = a;
  out.c = b;
  return intern(out);
}

FormulaGraph::Id FormulaGraph::insert(const Expression& expression, std::span<const Id> symbols) {
  std::vector<Id> id;
  id.reserve(expression.nodes.size());
  const auto operand = [&](int at) { return at < 0 ? -1 : id[at]; };
  for (const Expression::Node& at : expression.nodes) {
    id.push_back(at.op == Op::number ? number(at.value)
                 : at.op == Op::symbol
                     ? symbols[at.symbol]
                     : operation(at.op, operand(at.a), operand(at.b), operand(at.c)));
  }
  return id.back();
}

FormulaGraph::Partials FormulaGraph::partials(Id id) {
  const Node at = node(id);
  const Id one = number(1.0);
  const auto square = [this](Id x) { return product(x, x); };
  switch (at.op) {
    case Op::add:
      return {one, one};
    case Op::subtract:
      return {one, number(-1.0)};
    case Op::multiply:
      return {at.b, at.a};
    case Op::negate:
      return {number(-1.0), -1};
    case Op::reciprocal:
      return {negated(square(id)), -1};
    case Op::power: {
      const Id lower = power(at.a, difference(at.b, one));
      // x^y at x = 0 stays 0 around y > 0, though log x is infinite.
      const Id by_exponent = choice(operation(Op::not_equal, at.a, number(0.0)),
                                    product(id, operation(Op::log, at.a)), number(0.0));
      return {product(at.b, lower), by_exponent};
    }
    case Op::sin:
      return {operation(Op::cos, at.a), -1};
    case Op::cos:
      return {negated(operation(Op::sin, at.a)), -1};
    case Op::tan:
      return {sum(one, square(id)), -1};
    case Op::asin:
    case Op::acos: {
      const Id slope = reciprocal(operation(Op::sqrt, difference(one, square(at.a))));
      return {at.op == Op::asin ? slope : negated(slope), -1};
    }
    case Op::atan:
      return {reciprocal(sum(one, square(at.a))), -1};
    case Op::atan2: {
      const Id scale = reciprocal(sum(square(at.a), square(at.b)));
      return {product(at.b, scale), negated(product(at.a, scale))};
    }
    case Op::sinh:
      return {operation(Op::cosh, at.a), -1};
    case Op::cosh:
      return {operation(Op::sinh, at.a), -1};
    case Op::tanh:
      return {difference(one, square(id)), -1};
    case Op::exp:
      return {id, -1};
    case Op::log:
      return {reciprocal(at.a), -1};
    case Op::log10:
      return {product(number(1.0 / std::numbers::ln10), reciprocal(at.a)), -1};
    case Op::sqrt:
      return {product(number(0.5), reciprocal(id)), -1};
    case Op::abs:
      return {operation(Op::sign, at.a), -1};
    case Op::hypot: {
      const Id away = operation(Op::less, number(0.0), id), zero = number(0.0);
      const Id scale = reciprocal(id);
      return {choice(away, product(at.a, scale), zero), choice(away, product(at.b, scale), zero)};
    }
    default:
      return {};
  }
}

std::vector<bool> FormulaGraph::dependent(std::span<const int> symbols) const {
  std::vector<bool> out(nodes_.size(), false);
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    const Node& at = nodes_[i];
    if (at.op == Op::symbol) {
      out[i] = std::find(symbols.begin(), symbols.end(), at.symbol) != symbols.end();
    }
    for (const Id operand : {at.a, at.b, at.c}) {
      if (operand >= 0 && out[operand]) out[i] = true;
    }
  }
  return out;
}

std::vector<FormulaGraph::Id> FormulaGraph::reachable(Id root) const {
  std::vector<bool> seen(static_cast<std::size_t>(root) + 1, false);
  std::vector<Id> out;
  seen[root] = true;
  for (Id id = root; id >= 0; --id) {
    if (!seen[id]) continue;
    out.push_back(id);
    for (const Id operand : {node(id).a, node(id).b, node(id).c}) {
      if (operand >= 0) seen[operand] = true;
    }
  }
  std::reverse(out.begin(), out.end());
  return out;
}

std::vector<FormulaGraph::Id> FormulaGraph::gradient(Id root, std::span<const int> symbols) {
  work_ += nodes_.size() / 64;
  const std::vector<bool> depends = dependent(symbols);
  const auto moves = [&](Id id) { return id >= 0 && depends[id]; };
  const Id zero = number(0.0);

  // A sum that runs through a choice would multiply the slope of the side not taken by 0, which
  // fails where that slope is infinite. So each side of a choice has a gradient of its own.
  std::set<Id> wanted{root};
  for (const Id id : reachable(root)) {
    if (node(id).op != Op::choose || !moves(id)) continue;
    wanted.insert({id, node(id).b, node(id).c});
  }
  std::map<Id, std::vector<Id>> known;
  const std::vector<Id> nothing(symbols.size(), zero);
  const auto gradient_of = [&](Id id) -> const std::vector<Id>& {
    const auto hit = known.find(id);
    return hit == known.end() ? nothing : hit->second;
  };
  for (const Id start : wanted) {
    if (!moves(start)) continue;
    std::vector<Id> out = nothing;
    if (node(start).op == Op::choose) {
      const Node at = node(start);
      const std::vector<Id>& then = gradient_of(at.b);
      const std::vector<Id>& otherwise = gradient_of(at.c);
      for (std::size_t i = 0; i < out.size(); ++i) out[i] = choice(at.a, then[i], otherwise[i]);
      work_ += out.size();
      known.emplace(start, std::move(out));
      continue;
    }
    // Derivatives of `start` by the nodes below it, those with the largest numbers first.
    std::map<Id, Id, std::greater<>> by{{start, number(1.0)}};
    while (!by.empty()) {
      const Id id = by.begin()->first, slope = by.begin()->second;
      by.erase(by.begin());
      if (++work_ > kMaxWork) refuse_size();
      const Node at = node(id);
      if (at.op == Op::symbol) {
        for (std::size_t i = 0; i < out.size(); ++i) {
          if (symbols[i] == at.symbol) out[i] = sum(out[i], slope);
        }
        continue;
      }
      if (at.op == Op::choose) {
        const std::vector<Id>& inner = gradient_of(id);
        for (std::size_t i = 0; i < out.size(); ++i) out[i] = sum(out[i], product(slope, inner[i]));
        work_ += out.size();
        continue;
      }
      const Partials slopes = partials(id);
      const auto pass_on = [&](Id operand, Id partial) {
        if (!moves(operand) || partial < 0) return;
        const Id part = product(slope, partial);
        const auto [hit, is_new] = by.try_emplace(operand, part);
        if (!is_new) hit->second = sum(hit->second, part);
      };
      pass_on(at.a, slopes.a);
      pass_on(at.b, slopes.b);
    }
    known.emplace(start, std::move(out));
  }
  return gradient_of(root);
}

bool FormulaGraph::is_free_of(Id root, std::span<const int> symbols) const {
  for (const Id id : reachable(root)) {
    if (node(id).op == Op::symbol &&
        std::find(symbols.begin(), symbols.end(), node(id).symbol) != symbols.end()) {
      return false;
    }
  }
  return true;
}

bool FormulaGraph::is_affine(Id root, std::span<const int> symbols) {
  const std::vector<bool> depends = dependent(symbols);
  for (const Id id : reachable(root)) {
    const Op op = node(id).op;
    const bool kinked = is_condition(op) || op == Op::sign || op == Op::floor || op == Op::abs;
    const Id by = kinked ? id : op == Op::power ? node(id).b : -1;
    if (by >= 0 && depends[by]) return false;
  }
  const std::vector<Id> slopes = gradient(root, symbols);
  return std::all_of(slopes.begin(), slopes.end(),
                     [&](Id slope) { return is_free_of(slope, symbols); });
}

FormulaGraph::Id FormulaGraph::substitute(Id root, std::span<const double> value) {
  std::map<Id, Id> image;
  const auto operand = [&](Id id) { return id < 0 ? -1 : image.at(id); };
  for (const Id id : reachable(root)) {
    const Node at = node(id);
    Id out = id;
    if (at.op == Op::symbol) {
      const double known = value[at.symbol];
      if (!std::isnan(known)) out = number(known);
    } else if (at.op != Op::number) {
      out = operation(at.op, operand(at.a), operand(at.b), operand(at.c));
    }
    image.emplace(id, out);
  }
  return image.at(root);
}

std::vector<int> symbol_range(int first, int count) {
  std::vector<int> out(static_cast<std::size_t>(count));
  std::iota(out.begin(), out.end(), first);
  return out;
}

}  // namespace identikal
