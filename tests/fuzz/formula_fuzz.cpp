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

namespace {

const std::vector<std::string> kNames{"x", "y", "p", "q", "vx"};
const std::vector<bool> kHeld{false, false, true, true, false};

// Rounding of regrouped products may be magnified without limit by what follows (x - x', sin 1e20,
// floor), so equality is asked for only of what holds products, quotients and sums of like signs.
bool is_tame(const identikal::Expression& formula) {
  for (const identikal::Expression::Node& node : formula.nodes) {
    using identikal::Op;
    const bool number = node.op == Op::number && node.value > 1e-3 && node.value < 1e3;
    if (!(number || node.op == Op::symbol || node.op == Op::add || node.op == Op::multiply ||
          node.op == Op::divide || node.op == Op::sqrt)) {
      return false;
    }
  }
  return true;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  for (const identikal::FormulaKind kind :
       {identikal::FormulaKind::number, identikal::FormulaKind::condition}) {
    try {
      const identikal::Expression formula = identikal::parse_expression(text, kNames, kind);
      const std::array<double, 5> point{0.7, 1.3, 2.1, 0.4, 20.0};
      const double value = identikal::evaluate(formula, point);
      const std::vector<int> by{0, 2, 4};
      const identikal::Tape tape = identikal::compile({&formula, 1}, kHeld, by);
      identikal::TapeMemory memory = identikal::make_memory(tape);
      std::copy(point.begin(), point.end(), memory.begin());
      double f = 0.0;
      std::array<double, 3> J;
      evaluate_held(tape, memory);
      evaluate_jacobian(tape, memory, {&f, 1}, J);
      if (is_tame(formula) && std::isnormal(value) && std::abs(std::log(value)) < 100.0 &&
          !(std::abs(f - value) <= 1e-9 * std::abs(value))) {
        std::abort();
      }
      const std::vector<identikal::Dimension> units{
          {{1.0}}, {{1.0}}, {{0.0, 1.0}}, {}, {{1.0, 0.0, -1.0}}};
      identikal::dimension_of(formula, units);
    } catch (const identikal::FormulaError& error) {
      if (error.column() < 0 || error.column() > static_cast<int>(size) + 1) std::abort();
      if (std::string_view(error.what()).find('\n') != std::string_view::npos) std::abort();
    }
  }
  return 0;
}
