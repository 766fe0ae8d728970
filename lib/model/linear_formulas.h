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

/// What the symbols of a graph stand for: the parameters one after the other, and so the inputs.
struct SymbolPlaces {
  int first_parameter = 0, parameters = 0;
  int first_input = 0, inputs = 0;
  int time = -1;  ///< -1: none
};

/// Adds formulas to matrices: numbers to the constant part, sums of multiples of parameters to the
/// entries, and what is left as formulas, compiled together; those with inputs or time in them have
/// a value per sample.
/// @param graph  the nodes' graph
/// @param model  receives the compiled formulas; the matrices belong to it
/// @throws FormulaError when the derivatives are too large
void place_formulas(FormulaGraph& graph, const std::vector<PlacedFormula>& formulas,
                    const SymbolPlaces& symbols, LinearModel& model);

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

/// The same where factors of the states, and what is added to them, may hold inputs and time:
///
///   x' or x(t+1) = A(u, t, p) x + b(u, t, p),   y = C(u, t, p) x + d(u, t, p)
///
/// The columns of B and D that belong to inputs are zero; b and d are the offset's. In continuous
/// time A and b stay what they are at a sample until the next one, so that x' is free of the time,
/// and inputs are held constant.
///
/// Example:
///
///     const std::vector<std::string> names{"x", "u", "t"};  // state, input, time
///     ModelFormulas formulas{.states = 1, .inputs = 1};
///     formulas.dynamics = {parse_expression("-u*x", names)};
///     formulas.outputs = {parse_expression("x*sin(t)", names)};
///     const auto changing = changing_linear_model_of(insert_formulas(formulas));
///
/// @return nothing when it is not linear in the states
std::optional<LinearModel> changing_linear_model_of(FormulaNodes nodes);

}  // namespace identikal
