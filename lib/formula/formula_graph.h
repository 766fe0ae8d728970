// What do formulas have in common, and what are their derivatives? One graph of operations for all
// formulas of a model: an operation that occurs twice is one node.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <unordered_map>
#include <vector>

#include "lib/formula/expression.h"

namespace identikal {

class FormulaGraph {
 public:
  using Id = std::int32_t;  ///< a node; operands have smaller ones than what uses them

  struct Node {
    Op op = Op::number;
    Id a = -1, b = -1, c = -1;
    double value = 0.0;  ///< Op::number
    int symbol = -1;     ///< Op::symbol
    bool held = true;    ///< no symbol in it but held ones
  };

  /// @param held  per symbol: it stays while the formulas are evaluated many times, as parameters
  ///   do along a recording. Products are regrouped so that what is held is computed apart.
  explicit FormulaGraph(std::vector<bool> held);

  Id number(double value);
  Id symbol(int index);
  /// An operation on nodes. Numbers are folded; x + 0, 1 x, x^1, 0 x, -(-x) and the like are
  /// simplified, 0 x to 0 even though an infinite x would make it NaN. Small whole powers become
  /// products, a/b becomes a (1/b), min and max become choices. Rounding may differ from
  /// evaluate()'s in the last digits.
  /// @throws FormulaError when the graph gets larger than 200 000 nodes
  Id operation(Op op, Id a, Id b = -1, Id c = -1);

  /// A formula. @param symbols  node of each of its symbols: symbol(i), or a definition's node
  Id insert(const Expression& expression, std::span<const Id> symbols);

  /// Derivatives of `root` by symbols, exact, as nodes of the graph, by accumulation from the root
  /// (reverse mode). Of a choice, the derivative is the choice between the two sides' derivatives:
  /// what the side not taken does, be it infinite, has no influence. abs'(0) = 0, sign' = floor' =
  /// 0, hypot'(0, 0) = 0, min and max of equal numbers follow the first.
  ///
  /// Example:
  ///
  ///     const std::vector<std::string> names{"x", "p"};
  ///     FormulaGraph graph({false, true});  // p is held
  ///     const std::array symbols{graph.symbol(0), graph.symbol(1)};
  ///     const auto f = graph.insert(parse_expression("p*sin(x)", names), symbols);
  ///     const auto df_dx = graph.gradient(f, std::array{0});
  ///
  /// @throws FormulaError when the derivatives are too large
  std::vector<Id> gradient(Id root, std::span<const int> symbols);

  /// Is `root` of degree one at most in the symbols, with nothing in it that could make it
  /// otherwise (conditions, sign, floor, exponents)? Told from the form of the formula: x^2 - x^2
  /// is not.
  bool is_affine(Id root, std::span<const int> symbols);

  /// The node with numbers in the place of symbols. @param value  per symbol; NaN: it stays
  Id substitute(Id root, std::span<const double> value);

  /// Is the node free of these symbols?
  bool is_free_of(Id root, std::span<const int> symbols) const;

  const Node& node(Id id) const { return nodes_[id]; }
  bool is_number(Id id, double value) const;
  std::size_t size() const { return nodes_.size(); }
  std::size_t symbols() const { return held_.size(); }

 private:
  struct Key {
    Op op;
    Id a, b, c;
    std::uint64_t value;
    bool operator==(const Key&) const = default;
  };
  struct KeyHash {
    std::size_t operator()(const Key& key) const;
  };

  Id intern(const Node& node);
  Id sum(Id a, Id b);
  Id difference(Id a, Id b);
  Id product(Id a, Id b);
  Id negated(Id a);
  Id reciprocal(Id a);
  Id power(Id a, Id b);
  Id choice(Id condition, Id a, Id b);
  /// x = held * moving; either may be the number 1.
  struct Split {
    Id held, moving;
  };
  Split split(Id x);
  bool is_number(Id id) const { return node(id).op == Op::number; }
  /// Derivatives of a node by its operands.
  struct Partials {
    Id a = -1, b = -1;
  };
  Partials partials(Id id);
  std::vector<bool> dependent(std::span<const int> symbols) const;
  std::vector<Id> reachable(Id root) const;

  std::vector<bool> held_;
  std::vector<Node> nodes_;
  std::unordered_map<Key, Id, KeyHash> known_;
  std::size_t work_ = 0;  // steps of differentiation so far
};

/// The symbols first, first + 1, ..., `count` of them.
std::vector<int> symbol_range(int first, int count);

}  // namespace identikal
