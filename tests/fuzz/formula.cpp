// Whatever the text: no crash, no hang, no leak, and the tape says what the tree says.
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <string_view>
#include <vector>

#include "lib/formula/dimension.h"
#include "lib/formula/tape.h"
#include "tests/fuzz/targets.h"

namespace identikal::fuzz {
namespace {

const std::vector<std::string> kNames{"x", "y", "p", "q", "vx"};
const std::vector<bool> kHeld{false, false, true, true, false};

// Rounding of regrouped products may be magnified without limit by what follows (x - x', sin 1e20,
// floor), so equality is asked for only of what holds products, quotients and sums of like signs.
bool is_tame(const Expression& given) {
  for (const Expression::Node& node : given.nodes) {
    const bool number = node.op == Op::number && node.value > 1e-3 && node.value < 1e3;
    if (!(number || node.op == Op::symbol || node.op == Op::add || node.op == Op::multiply ||
          node.op == Op::divide || node.op == Op::sqrt)) {
      return false;
    }
  }
  return true;
}

}  // namespace

void formula(std::string_view text) {
  for (const FormulaKind kind : {FormulaKind::number, FormulaKind::condition}) {
    try {
      const Expression parsed = parse_expression(text, kNames, kind);
      const std::array<double, 5> point{0.7, 1.3, 2.1, 0.4, 20.0};
      const double value = evaluate(parsed, point);
      const std::vector<int> by{0, 2, 4};
      const Tape tape = compile({&parsed, 1}, kHeld, by);
      TapeMemory memory = make_memory(tape);
      std::copy(point.begin(), point.end(), memory.begin());
      double f = 0.0;
      std::array<double, 3> J;
      evaluate_held(tape, memory);
      evaluate_jacobian(tape, memory, {&f, 1}, J);
      if (is_tame(parsed) && std::isnormal(value) && std::abs(std::log(value)) < 100.0 &&
          !(std::abs(f - value) <= 1e-9 * std::abs(value))) {
        std::abort();
      }
      const std::vector<Dimension> units{{{1.0}}, {{1.0}}, {{0.0, 1.0}}, {}, {{1.0, 0.0, -1.0}}};
      dimension_of(parsed, units);
    } catch (const FormulaError& error) {
      if (error.column() < 0 || error.column() > static_cast<int>(text.size()) + 1) std::abort();
      require_one_line(error.what());
    }
  }
}

}  // namespace identikal::fuzz
