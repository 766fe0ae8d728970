// Are a model's formulas linear, and which matrices do they make then?
#pragma once

#include <optional>
#include <vector>

#include "lib/formula/formula_graph.h"
#include "lib/model/linear_model.h"
#include "lib/model/nonlinear_model.h"

namespace identikal {

/// A formula of the parameters and its place in a matrix, whose constant part has the shape.
struct PlacedFormula {
  ParametrisedMatrix* matrix;
  int row, col;
  FormulaGraph::Id value;
};

/// Adds formulas to matrices: numbers to the constant part, sums of multiples of parameters to the
/// entries, and what is left as formulas, compiled together.
/// @param graph       the nodes' graph
/// @param parameters  number of them; the symbols from `first` on are these
/// @param model       receives the compiled formulas; the matrices belong to it
/// @throws FormulaError when the derivatives are too large
void place_formulas(FormulaGraph& graph, const std::vector<PlacedFormula>& formulas, int first,
                    int parameters, LinearModel& model);

/// A, B, C and D of x' or x(t+1) = A x + B u + c, y = C x + D u + d, where the formulas are so,
/// whatever the parameters: nothing but products of a state or an input with what is free of both.
/// An offset, c or d, becomes a last column of B and D (LinearModel::offset). Told from the form
/// of the formulas: x^2 - x^2 is not linear.
///
/// Example:
///
///     const std::vector<std::string> names{"x", "tau", "t"};  // state, parameter, time
///     ModelFormulas formulas{.states = 1, .parameters = 1};
///     formulas.dynamics = {parse_expression("-x/tau", names)};
///     formulas.outputs = {parse_expression("x", names)};
///     const std::optional<LinearModel> linear = linear_model_of(formulas);
///
/// @return a model whose other matrices are empty; nothing when it is not linear
std::optional<LinearModel> linear_model_of(FormulaNodes nodes);
inline std::optional<LinearModel> linear_model_of(const ModelFormulas& formulas) {
  return linear_model_of(insert_formulas(formulas));
}

}  // namespace identikal
