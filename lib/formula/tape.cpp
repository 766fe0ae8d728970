#include "lib/formula/tape.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <map>
#include <utility>

#include "lib/formula/internal/tape_codes.h"

namespace identikal {
namespace {

using Id = FormulaGraph::Id;

constexpr std::size_t kMostTerms = 1000;  // of one instruction

/// Turns nodes into instructions. A product that only one sum needs becomes part of that sum's
/// instruction, a reciprocal that only one product needs a division.
class TapeLayout {
 public:
  TapeLayout(const FormulaGraph& graph, std::span<const Id> values,
             std::span<const std::vector<Id>> jacobian)
      : graph_(graph), uses_(graph.size(), 0), part_(graph.size(), kUnused) {
    for (const Id id : values) {
      mark(id, kForValues);
      result(id);
    }
    for (const std::vector<Id>& row : jacobian) {
      for (const Id id : row) {
        mark(id, kForJacobian);
        result(id);
      }
    }
  }

  Tape lay_out(std::size_t symbols) {
    out_.symbols = symbols;
    out_.start.assign(symbols, 0.0);
    one_ = constant(1.0);
    slot_.assign(graph_.size(), 0);
    absorb();
    for (std::size_t i = 0; i < graph_.size(); ++i) {
      const FormulaGraph::Node& node = graph_.node(static_cast<Id>(i));
      if (part_[i] == kUnused) continue;
      if (node.op == Op::number) slot_[i] = constant(node.value);
      if (node.op == Op::symbol) slot_[i] = static_cast<std::uint32_t>(node.symbol);
    }
    out_.first_result = out_.start.size();
    emit(kHeld);
    out_.held_end = out_.code.size();
    emit(kForValues);
    out_.values_end = out_.code.size();
    emit(kForJacobian);
    out_.start.resize(out_.first_result + out_.code.size(), 0.0);
    return std::move(out_);
  }

  std::uint32_t slot(Id id) const { return slot_[id]; }

 private:
  enum Part : std::uint8_t { kUnused, kHeld, kForValues, kForJacobian };
  struct Term {
    bool negative;
    std::uint32_t a, b;
  };

  std::size_t& uses(Id id) { return uses_[id]; }
  Part& part(Id id) { return part_[id]; }
  static bool is_sum(Op op) { return op == Op::add || op == Op::subtract || op == Op::negate; }

  // Everything below a node that is not needed by an earlier part.
  void mark(Id root, Part part_of_moving) {
    std::vector<Id> open{root};
    while (!open.empty()) {
      const Id id = open.back();
      open.pop_back();
      if (part(id) != kUnused) continue;
      const FormulaGraph::Node& node = graph_.node(id);
      part(id) = node.held ? kHeld : part_of_moving;
      for (const Id operand : {node.a, node.b, node.c}) {
        if (operand < 0) continue;
        ++uses(operand);
        open.push_back(operand);
      }
    }
  }

  // What leaves the tape is never part of another instruction.
  void result(Id id) { uses(id) += 2; }

  // Which nodes become part of the one that uses them: those with one user, in the same part.
  void absorb() {
    absorbed_.assign(graph_.size(), false);
    for (std::size_t i = 0; i < graph_.size(); ++i) {
      if (part_[i] == kUnused) continue;
      const FormulaGraph::Node& user = graph_.node(static_cast<Id>(i));
      for (const Id operand : {user.a, user.b}) {
        if (operand < 0 || uses(operand) != 1 || part(operand) != part_[i]) continue;
        const Op op = graph_.node(operand).op;
        absorbed_[operand] = is_sum(user.op) ? is_sum(op) || op == Op::multiply
                                             : user.op == Op::multiply && op == Op::reciprocal;
      }
    }
  }
  bool absorbed(Id id) const { return absorbed_[id]; }

  std::uint32_t constant(double value) {
    const auto [hit, is_new] = constants_.try_emplace(
        std::bit_cast<std::uint64_t>(value), static_cast<std::uint32_t>(out_.start.size()));
    if (is_new) out_.start.push_back(value);
    return hit->second;
  }

  void emit(Part wanted) {
    for (std::size_t i = 0; i < graph_.size(); ++i) {
      if (part_[i] != wanted || absorbed_[i]) continue;
      const auto id = static_cast<Id>(i);
      const FormulaGraph::Node& node = graph_.node(id);
      if (node.op == Op::number || node.op == Op::symbol) continue;
      if (is_sum(node.op)) {
        emit_sum(id);
      } else if (node.op == Op::multiply) {
        emit_product(node);
      } else {
        const auto operand = [&](Id at) { return at < 0 ? 0 : slot(at); };
        push({static_cast<std::uint16_t>(node.op), 0, 0, operand(node.a), operand(node.b),
              operand(node.c), 0});
      }
      slot_[i] = static_cast<std::uint32_t>(out_.first_result + out_.code.size() - 1);
    }
  }

  void push(const Tape::Instruction& instruction) { out_.code.push_back(instruction); }
  void push(int code, std::uint32_t a, std::uint32_t b, std::uint32_t c = 0, std::uint32_t d = 0) {
    push({static_cast<std::uint16_t>(code), 0, 0, a, b, c, d});
  }

  void emit_product(const FormulaGraph::Node& node) {
    if (absorbed(node.b)) {
      if (!absorbed(node.a)) {
        push(static_cast<int>(Op::divide), slot(node.a), slot(graph_.node(node.b).a));
        return;
      }
      push(static_cast<int>(Op::reciprocal), slot(graph_.node(node.b).a), 0);
      const auto reciprocal = static_cast<std::uint32_t>(out_.first_result + out_.code.size() - 1);
      push(static_cast<int>(Op::divide), reciprocal, slot(graph_.node(node.a).a));
      return;
    }
    if (absorbed(node.a)) {
      push(static_cast<int>(Op::divide), slot(node.b), slot(graph_.node(node.a).a));
      return;
    }
    push(static_cast<int>(Op::multiply), slot(node.a), slot(node.b));
  }

  // The sum's terms, first in the formula first. Absorbed products with a division of their own
  // are computed before.
  std::vector<Term> terms_of(Id root) {
    struct Open {
      Id id;
      bool negative;
    };
    std::vector<Open> open{{root, false}};
    std::vector<Term> out;
    while (!open.empty()) {
      const Open now = open.back();
      open.pop_back();
      const FormulaGraph::Node& node = graph_.node(now.id);
      const bool inside = now.id == root || absorbed(now.id);
      if (inside && is_sum(node.op)) {
        if (node.b >= 0) open.push_back({node.b, now.negative != (node.op == Op::subtract)});
        open.push_back({node.a, now.negative != (node.op == Op::negate)});
      } else if (inside && absorbed(node.a) + absorbed(node.b) > 0) {
        emit_product(node);
        out.push_back({now.negative,
                       static_cast<std::uint32_t>(out_.first_result + out_.code.size() - 1), one_});
      } else if (inside) {
        out.push_back({now.negative, slot(node.a), slot(node.b)});
      } else {
        out.push_back({now.negative, slot(now.id), one_});
      }
    }
    return out;
  }

  void emit_sum(Id root) {
    std::vector<Term> terms = terms_of(root);
    // Plain terms and negative ones last: the short forms below then are few.
    std::stable_sort(terms.begin(), terms.end(),
                     [](const Term& x, const Term& y) { return x.negative < y.negative; });
    const auto plain = [this](const Term& term) { return term.b == one_; };
    if (terms.size() == 1) {
      const Term& t = terms[0];
      if (plain(t)) {
        push(static_cast<int>(Op::negate), t.a, 0);
      } else {
        push_terms(terms);
      }
      return;
    }
    if (terms.size() == 2) {
      const Term &x = terms[0], &y = terms[1];
      if (!x.negative && y.negative) {
        if (plain(x) && plain(y)) return push(static_cast<int>(Op::subtract), x.a, y.a);
        if (plain(y)) return push(kMultiplySubtract, x.a, x.b, y.a);
        if (plain(x)) return push(kSubtractProduct, y.a, y.b, x.a);
      } else if (!x.negative) {
        if (plain(x) && plain(y)) return push(static_cast<int>(Op::add), x.a, y.a);
        if (plain(y)) return push(kMultiplyAdd, x.a, x.b, y.a);
        if (plain(x)) return push(kMultiplyAdd, y.a, y.b, x.a);
        return push(kTwoProducts, x.a, x.b, y.a, y.b);
      }
    }
    push_terms(terms);
  }

  void push_terms(const std::vector<Term>& terms) {
    for (std::size_t begin = 0; begin < terms.size();) {
      Tape::Instruction sum;
      sum.code = kSumOfProducts;
      sum.d = static_cast<std::uint32_t>(out_.places.size());
      const std::size_t end = std::min(terms.size(), begin + kMostTerms);
      std::vector<Term> part(terms.begin() + static_cast<std::ptrdiff_t>(begin),
                             terms.begin() + static_cast<std::ptrdiff_t>(end));
      if (begin > 0) {
        const auto before = static_cast<std::uint32_t>(out_.first_result + out_.code.size() - 1);
        part.insert(part.begin(), {false, before, one_});
      }
      for (const Term& term : part) {
        ++(term.negative ? sum.negative : sum.positive);
        out_.places.insert(out_.places.end(), {term.a, term.b});
      }
      if (sum.positive == 3 && sum.negative == 0) sum.code = kThreeProducts;
      push(sum);
      begin = end;
    }
  }

  const FormulaGraph& graph_;
  std::vector<std::size_t> uses_;
  std::vector<Part> part_;
  std::vector<bool> absorbed_;
  std::vector<std::uint32_t> slot_;
  std::map<std::uint64_t, std::uint32_t> constants_;
  std::uint32_t one_ = 0;
  Tape out_;
};

void run_tape_part(const Tape& tape, double* s, std::size_t begin, std::size_t end) {
  const Tape::Instruction* at = tape.code.data() + begin;
  const Tape::Instruction* const stop = tape.code.data() + end;
  double* result = s + tape.first_result + begin;
  for (; at != stop; ++at, ++result) {
    const double a = s[at->a];
    switch (at->code) {
      case static_cast<int>(Op::multiply):
        *result = a * s[at->b];
        break;
      case static_cast<int>(Op::add):
        *result = a + s[at->b];
        break;
      case static_cast<int>(Op::subtract):
        *result = a - s[at->b];
        break;
      case static_cast<int>(Op::divide):
        *result = a / s[at->b];
        break;
      case static_cast<int>(Op::reciprocal):
        *result = 1.0 / a;
        break;
      case static_cast<int>(Op::negate):
        *result = -a;
        break;
      case static_cast<int>(Op::choose):
        *result = a != 0.0 ? s[at->b] : s[at->c];
        break;
      case static_cast<int>(Op::greater_equal):
        *result = a >= s[at->b] ? 1.0 : 0.0;
        break;
      case static_cast<int>(Op::less_equal):
        *result = a <= s[at->b] ? 1.0 : 0.0;
        break;
      case static_cast<int>(Op::sqrt):
        *result = std::sqrt(a);
        break;
      case kMultiplyAdd:
        *result = a * s[at->b] + s[at->c];
        break;
      case kMultiplySubtract:
        *result = a * s[at->b] - s[at->c];
        break;
      case kSubtractProduct:
        *result = s[at->c] - a * s[at->b];
        break;
      case kTwoProducts:
        *result = a * s[at->b] + s[at->c] * s[at->d];
        break;
      case kThreeProducts: {
        const std::uint32_t* place = tape.places.data() + at->d;
        *result = s[place[0]] * s[place[1]] + s[place[2]] * s[place[3]] + s[place[4]] * s[place[5]];
        break;
      }
      case kSumOfProducts: {
        const std::uint32_t* place = tape.places.data() + at->d;
        double sum = 0.0;
        for (int k = at->positive; k > 0; --k, place += 2) sum += s[place[0]] * s[place[1]];
        for (int k = at->negative; k > 0; --k, place += 2) sum -= s[place[0]] * s[place[1]];
        *result = sum;
        break;
      }
      default:
        *result = apply(static_cast<Op>(at->code), a, s[at->b], s[at->c]);
    }
  }
}

}  // namespace

Tape make_tape(const FormulaGraph& graph, std::span<const FormulaGraph::Id> values,
               std::span<const std::vector<FormulaGraph::Id>> jacobian) {
  TapeLayout layout(graph, values, jacobian);
  Tape out = layout.lay_out(graph.symbols());
  out.values = values.size();
  out.columns = jacobian.empty() ? 0 : jacobian.front().size();
  for (const Id id : values) out.value_slot.push_back(layout.slot(id));
  for (const std::vector<Id>& row : jacobian) {
    for (const Id id : row) out.jacobian_slot.push_back(layout.slot(id));
  }
  return out;
}

Tape compile(std::span<const Expression> formulas, const std::vector<bool>& held,
             std::span<const int> by) {
  FormulaGraph graph(held);
  std::vector<Id> symbols, values;
  for (int i = 0; i < static_cast<int>(held.size()); ++i) symbols.push_back(graph.symbol(i));
  for (const Expression& formula : formulas) values.push_back(graph.insert(formula, symbols));
  std::vector<std::vector<Id>> jacobian;
  for (const Id value : values) {
    if (!by.empty()) jacobian.push_back(graph.gradient(value, by));
  }
  return make_tape(graph, values, jacobian);
}

TapeMemory make_memory(const Tape& tape) { return tape.start; }

void evaluate_held(const Tape& tape, TapeMemory& memory) {
  run_tape_part(tape, memory.data(), 0, tape.held_end);
}

void evaluate_values(const Tape& tape, TapeMemory& memory, std::span<double> values) {
  run_tape_part(tape, memory.data(), tape.held_end, tape.values_end);
  for (std::size_t i = 0; i < tape.values; ++i) values[i] = memory[tape.value_slot[i]];
}

void evaluate_jacobian(const Tape& tape, TapeMemory& memory, std::span<double> values,
                       std::span<double> jacobian) {
  run_tape_part(tape, memory.data(), tape.held_end, tape.code.size());
  for (std::size_t i = 0; i < tape.values; ++i) values[i] = memory[tape.value_slot[i]];
  for (std::size_t i = 0; i < tape.jacobian_slot.size(); ++i) {
    jacobian[i] = memory[tape.jacobian_slot[i]];
  }
}

}  // namespace identikal
