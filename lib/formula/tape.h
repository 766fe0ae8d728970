// How are several formulas and their derivatives evaluated a million times?
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "lib/formula/expression.h"
#include "lib/formula/formula_graph.h"

namespace identikal {

/// A straight list of instructions for several formulas and, where requested, their Jacobian. What
/// they have in common is computed once, what holds no symbol but held ones (parameters) only when
/// those change.
struct Tape {
  struct Instruction {
    std::uint16_t code = 0;
    std::uint16_t positive = 0, negative = 0;  ///< terms of a sum of products
    std::uint32_t a = 0, b = 0, c = 0,
                  d = 0;  ///< slots; of a sum of products, d is its first place
  };
  std::size_t symbols = 0;
  std::size_t values = 0;             ///< number of formulas
  std::size_t columns = 0;            ///< of the Jacobian
  std::vector<double> start;          ///< slots: symbols, numbers, one per instruction
  std::vector<Instruction> code;      ///< that number i writes slot first_result + i
  std::vector<std::uint32_t> places;  ///< slots of the factors in sums of products
  std::size_t first_result = 0, held_end = 0, values_end = 0;
  std::vector<std::uint32_t> value_slot;     ///< per formula
  std::vector<std::uint32_t> jacobian_slot;  ///< row by row
};

/// Lays out nodes of a graph.
/// @param values    one node per formula
/// @param jacobian  the same number of rows each, derivatives of that formula; empty: none
Tape make_tape(const FormulaGraph& graph, std::span<const FormulaGraph::Id> values,
               std::span<const std::vector<FormulaGraph::Id>> jacobian = {});

/// Compiles formulas over the same symbols.
///
/// Example:
///
///     const std::vector<std::string> names{"x", "p"};
///     const std::vector<Expression> formulas{parse_expression("p*sin(x)", names)};
///     const Tape tape = compile(formulas, {false, true}, std::array{0, 1});  // p is held
///     TapeMemory memory = make_memory(tape);
///     memory[0] = 0.3, memory[1] = 2.0;  // then evaluate_held() and evaluate_jacobian()
///
/// @param held  per symbol: changes rarely, see evaluate_held()
/// @param by    symbols that the Jacobian is taken by, in this order; empty: no Jacobian
/// @throws FormulaError when the derivatives are too large (lib/formula/formula_graph.h)
Tape compile(std::span<const Expression> formulas, const std::vector<bool>& held,
             std::span<const int> by = {});

/// The memory that a tape is evaluated in; one per thread. The first `tape.symbols` numbers are the
/// symbols: write them there.
using TapeMemory = std::vector<double>;
TapeMemory make_memory(const Tape& tape);

/// To be called after held symbols were written, before the other two.
void evaluate_held(const Tape& tape, TapeMemory& memory);

/// @param values  tape.values numbers, written
void evaluate_values(const Tape& tape, TapeMemory& memory, std::span<double> values);

/// Values and exact derivatives. Nothing is allocated here and above.
/// @param jacobian  tape.values x tape.columns numbers, row by row, written
void evaluate_jacobian(const Tape& tape, TapeMemory& memory, std::span<double> values,
                       std::span<double> jacobian);

}  // namespace identikal
