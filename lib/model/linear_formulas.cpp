#include "lib/model/linear_formulas.h"

#include "lib/base/constants.h"

namespace identikal {
namespace {

using Id = FormulaGraph::Id;

// The factors of a formula that is a sum of multiples of symbols; nothing when it is another.
std::optional<std::vector<double>> factors(FormulaGraph& graph, Id value,
                                           const std::vector<int>& symbols) {
  if (!graph.is_affine(value, symbols)) return std::nullopt;
  std::vector<double> out;
  for (const Id id : graph.gradient(value, symbols)) {
    if (graph.node(id).op != Op::number) return std::nullopt;
    out.push_back(graph.node(id).value);
  }
  return out;
}

// A formula with symbols at zero.
Id at_zero(FormulaGraph& graph, Id value, const std::vector<int>& symbols) {
  std::vector<double> values(graph.symbols(), kNaN);
  for (const int symbol : symbols) values[symbol] = 0.0;
  return graph.substitute(value, values);
}

}  // namespace

void place_formulas(FormulaGraph& graph, const std::vector<PlacedFormula>& formulas,
                    const SymbolPlaces& places, LinearModel& model) {
  const int first = places.first_parameter, parameters = places.parameters;
  const std::vector<int> symbols = symbol_range(first, parameters);
  std::vector<int> moving = symbol_range(places.first_input, places.inputs);
  if (places.time >= 0) moving.push_back(places.time);
  std::vector<Id> values;
  for (const PlacedFormula& placed : formulas) {
    ParametrisedMatrix& matrix = *placed.matrix;
    if (const auto multiples = factors(graph, placed.value, symbols)) {
      const Id rest = at_zero(graph, placed.value, symbols);
      if (graph.node(rest).op == Op::number) {
        matrix.constant(placed.row, placed.col) += graph.node(rest).value;
        for (int i = 0; i < parameters; ++i) {
          const double factor = (*multiples)[i];
          if (factor != 0.0) matrix.entries.push_back({placed.row, placed.col, i, factor});
        }
        continue;
      }
    }
    ParametrisedMatrix::Formula formula{placed.row,
                                        placed.col,
                                        static_cast<int>(model.formulas.size()),
                                        static_cast<int>(values.size()),
                                        {},
                                        !graph.is_free_of(placed.value, moving)};
    for (int i = 0; i < parameters; ++i) {
      if (!graph.is_free_of(placed.value, std::vector<int>{first + i})) {
        formula.parameters.push_back(i);
      }
    }
    values.push_back(placed.value);
    matrix.formulas.push_back(std::move(formula));
  }
  if (values.empty()) return;
  std::vector<std::vector<Id>> jacobian;
  for (const Id value : values) jacobian.push_back(graph.gradient(value, symbols));
  model.formulas.push_back(
      {make_tape(graph, values, jacobian), first, places.first_input, places.inputs, places.time});
}

namespace {

SymbolPlaces places_of(const FormulaNodes& nodes) {
  const int first = nodes.states + nodes.inputs;
  return {first, nodes.parameters, nodes.states, nodes.inputs, first + nodes.parameters};
}

// Matrices of zeros in the formulas' sizes.
void set_sizes(const FormulaNodes& nodes, LinearModel& out) {
  const Eigen::Index columns = nodes.inputs + (out.offset ? 1 : 0);
  const auto ny = static_cast<Eigen::Index>(nodes.outputs.size());
  out.A.constant.setZero(nodes.states, nodes.states);
  out.B.constant.setZero(nodes.states, columns);
  out.C.constant.setZero(ny, nodes.states);
  out.D.constant.setZero(ny, columns);
}

}  // namespace

std::optional<LinearModel> linear_model_of(FormulaNodes nodes) {
  FormulaGraph& graph = nodes.graph;
  const int nx = nodes.states, nu = nodes.inputs, first = nx + nu;
  const std::vector<int> x = symbol_range(0, nx), u = symbol_range(nx, nu),
                         moving = symbol_range(0, nx + nu),
                         time = symbol_range(first + nodes.parameters, 1);
  LinearModel out;
  out.continuous = nodes.continuous;
  std::vector<PlacedFormula> placed;
  // One row of [A B c] or [C D d].
  const auto place_row = [&](const std::vector<Id>& rows, ParametrisedMatrix& wrt_x,
                             ParametrisedMatrix& by_u) {
    for (std::size_t i = 0; i < rows.size(); ++i) {
      if (!graph.is_free_of(rows[i], time) || !graph.is_affine(rows[i], moving)) return false;
      const auto place = [&](const std::vector<Id>& jacobian, ParametrisedMatrix& to) {
        for (std::size_t j = 0; j < jacobian.size(); ++j) {
          placed.push_back({&to, static_cast<int>(i), static_cast<int>(j), jacobian[j]});
        }
      };
      place(graph.gradient(rows[i], x), wrt_x);
      place(graph.gradient(rows[i], u), by_u);
      const Id offset = at_zero(graph, rows[i], moving);
      out.offset = out.offset || !graph.is_number(offset, 0.0);
      placed.push_back({&by_u, static_cast<int>(i), nu, offset});
    }
    return true;
  };
  if (!place_row(nodes.dynamics, out.A, out.B) || !place_row(nodes.outputs, out.C, out.D)) {
    return std::nullopt;
  }
  if (!out.offset) {
    std::erase_if(placed, [&](const PlacedFormula& p) {
      return p.col == nu && (p.matrix == &out.B || p.matrix == &out.D);
    });
  }
  set_sizes(nodes, out);
  place_formulas(graph, placed, places_of(nodes), out);
  return out;
}

std::optional<LinearModel> changing_linear_model_of(FormulaNodes nodes) {
  FormulaGraph& graph = nodes.graph;
  const std::vector<int> x = symbol_range(0, nodes.states);
  const SymbolPlaces places = places_of(nodes);
  LinearModel out;
  out.continuous = nodes.continuous;
  out.offset = true;
  set_sizes(nodes, out);
  std::vector<PlacedFormula> placed;
  // One row of [A b] or [C d].
  const auto place_row = [&](int row, Id value, ParametrisedMatrix& wrt_x, ParametrisedMatrix& by) {
    if (!graph.is_affine(value, x)) return false;
    const std::vector<Id> factors = graph.gradient(value, x);
    for (int j = 0; j < nodes.states; ++j) placed.push_back({&wrt_x, row, j, factors[j]});
    placed.push_back({&by, row, nodes.inputs, at_zero(graph, value, x)});
    return true;
  };
  for (int i = 0; i < nodes.states; ++i) {
    if (nodes.continuous && !graph.is_free_of(nodes.dynamics[i], std::vector<int>{places.time})) {
      return std::nullopt;
    }
    if (!place_row(i, nodes.dynamics[i], out.A, out.B)) return std::nullopt;
  }
  for (std::size_t i = 0; i < nodes.outputs.size(); ++i) {
    if (!place_row(static_cast<int>(i), nodes.outputs[i], out.C, out.D)) return std::nullopt;
  }
  place_formulas(graph, placed, places, out);
  return out;
}

}  // namespace identikal
