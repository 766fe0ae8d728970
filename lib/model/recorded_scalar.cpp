#include "lib/model/recorded_scalar.h"

#include <stdexcept>

namespace identikal {

FormulaGraph::Id RecordedScalar::in(FormulaGraph& graph) const {
  if (graph_ == nullptr) return graph.number(value_);
  if (graph_ != &graph) throw std::invalid_argument("RecordedScalar: values of two graphs meet");
  return id_;
}

RecordedScalar RecordedScalar::of(Op op, const RecordedScalar& a, const RecordedScalar& b,
                                  const RecordedScalar& c) {
  const int count = operands(op);
  FormulaGraph* graph = a.graph_;
  if (graph == nullptr && count > 1) graph = b.graph_;
  if (graph == nullptr && count > 2) graph = c.graph_;
  if (graph == nullptr) return apply(op, a.value_, b.value_, c.value_);
  return {*graph, graph->operation(op, a.in(*graph), count > 1 ? b.in(*graph) : -1,
                                   count > 2 ? c.in(*graph) : -1)};
}

FormulaNodes empty_nodes(const ModelSizes& sizes) {
  std::vector<bool> held(
      static_cast<std::size_t>(sizes.states + sizes.inputs + sizes.parameters + 1), false);
  for (int i = 0; i < sizes.parameters; ++i) {
    held[sizes.states + sizes.inputs + i] = true;
  }
  return {FormulaGraph(held), {}, {}, sizes.states, sizes.inputs, sizes.parameters,
          sizes.continuous};
}

RecordedArguments recorded_arguments(FormulaNodes& nodes) {
  int symbol = 0;
  const auto take = [&](int count) {
    std::vector<RecordedScalar> out;
    for (int i = 0; i < count; ++i) out.emplace_back(nodes.graph, nodes.graph.symbol(symbol++));
    return out;
  };
  RecordedArguments out;
  out.x = take(nodes.states);
  out.u = take(nodes.inputs);
  out.p = take(nodes.parameters);
  out.time = take(1).front();
  return out;
}

}  // namespace identikal
