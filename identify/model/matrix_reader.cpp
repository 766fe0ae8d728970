#include "identify/model/matrix_reader.h"

#include <algorithm>
#include <cctype>
#include <map>
#include <string_view>
#include <tuple>

#include <Eigen/Eigenvalues>
#include <fmt/format.h>

#include "identify/model/model_values.h"
#include "lib/formula/formula_graph.h"
#include "lib/model/linear_formulas.h"

namespace identikal {
bool is_name(std::string_view text) {
  const auto is_letter = [](char c) {
    return std::isalpha(static_cast<unsigned char>(c)) != 0 || c == '_' || (c & 0x80) != 0;
  };
  return !text.empty() && is_letter(text.front()) &&
         std::all_of(text.begin(), text.end(), [&](char c) {
           return is_letter(c) || std::isdigit(static_cast<unsigned char>(c)) != 0;
         });
}

namespace {

/// The nodes of a matrix's entries, row by row; rectangular and not empty.
using Grid = std::vector<std::vector<const YamlNode*>>;

Grid read_grid(const YamlNode& node, const std::string& name) {
  if (node.kind == YamlNode::Kind::scalar) return {{&node}};
  Grid out;
  for (const YamlNode& row : node.items) {
    if (node.kind != YamlNode::Kind::list || row.kind != YamlNode::Kind::list) break;
    out.emplace_back();
    for (const YamlNode& entry : row.items) out.back().push_back(&entry);
    if (out.back().size() != out.front().size()) {
      throw InputError(
          row.at, fmt::format("row {} of {} has length {}", out.size(), name, out.back().size()),
          fmt::format("{}, as in row 1", out.front().size()));
    }
  }
  if (out.empty() || out.size() != node.items.size() || out.front().empty()) {
    throw InputError(node.at, fmt::format("{} is not a matrix", name),
                     "a list of rows such as [[1, 0], [0, 1]]");
  }
  if (static_cast<Eigen::Index>(std::max(out.size(), out.front().size())) > kMaxSize) {
    throw InputError(node.at, fmt::format("{} is {} x {}", name, out.size(), out.front().size()),
                     fmt::format("at most {0} x {0}", kMaxSize));
  }
  return out;
}

void check_shape(const Grid& grid, const YamlNode& node, const std::string& name,
                 const MatrixShape& want) {
  const auto rows = static_cast<Eigen::Index>(grid.size());
  const auto cols = static_cast<Eigen::Index>(grid.front().size());
  if ((want.rows == kAnySize || rows == want.rows) && (want.cols == kAnySize || cols == want.cols))
    return;
  const auto side = [](Eigen::Index size) {
    return size == kAnySize ? "any" : std::to_string(size);
  };
  throw InputError(node.at, fmt::format("{} is {} x {}", name, rows, cols),
                   fmt::format("{} x {} ({})", side(want.rows), side(want.cols), want.sides));
}

using FormulaId = FormulaGraph::Id;

// A matrix and the nodes of its entries, row by row: two entries are the same when their nodes are.
struct Entries {
  ParametrisedMatrix matrix;
  std::vector<FormulaId> nodes;
};

Entries read_entries(const Grid& grid, const std::string& name, NamedParameters& parameters,
                     LinearModel& model) {
  const auto rows = static_cast<Eigen::Index>(grid.size());
  const auto cols = static_cast<Eigen::Index>(grid.front().size());
  Entries out;
  out.matrix.constant.setZero(rows, cols);
  const std::vector<std::string> names = parameters.symbols();
  FormulaGraph graph = graph_of(parameters);
  const std::vector<FormulaId> symbols = symbols_of(graph);
  std::vector<PlacedFormula> placed;
  for (int i = 0; i < rows; ++i) {
    for (int j = 0; j < cols; ++j) {
      const YamlNode& node = *grid[i][j];
      const Expression formula = read_formula(node, "an entry of " + name, names, 0, parameters);
      out.nodes.push_back(graph.insert(formula, symbols));
      placed.push_back({&out.matrix, i, j, out.nodes.back()});
    }
  }
  place_formulas(graph, placed, parameters.places(), model);
  return out;
}

double smallest_eigenvalue(const Eigen::MatrixXd& M) {
  return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(M, Eigen::EigenvaluesOnly)
      .eigenvalues()
      .minCoeff();
}

// Up to rounding in numbers that a person wrote.
bool is_semidefinite(const Eigen::MatrixXd& M) {
  return smallest_eigenvalue(M) >= -1e-12 * M.cwiseAbs().maxCoeff();
}

// A start as a number (times I), a list of the diagonal's entries, or a matrix.
Eigen::MatrixXd read_start(const YamlNode* node, const std::string& name, Eigen::Index size,
                           const char* sides) {
  if (node == nullptr) return Eigen::MatrixXd::Identity(size, size);
  const std::string what = "start of " + name;
  if (node->kind == YamlNode::Kind::scalar) {
    return read_plain_number(*node, what) * Eigen::MatrixXd::Identity(size, size);
  }
  const bool is_diagonal = node->kind == YamlNode::Kind::list && !node->items.empty() &&
                           node->items.front().kind != YamlNode::Kind::list;
  if (!is_diagonal) {
    const Grid grid = read_grid(*node, what);
    check_shape(grid, *node, what, {size, size, sides});
    Eigen::MatrixXd out(size, size);
    for (Eigen::Index i = 0; i < size; ++i) {
      for (Eigen::Index j = 0; j < size; ++j) {
        out(i, j) = read_plain_number(*grid[i][j], what);
      }
    }
    return out;
  }
  if (static_cast<Eigen::Index>(node->items.size()) != size) {
    throw InputError(node->at, fmt::format("{} has length {}", what, node->items.size()),
                     fmt::format("{}, the diagonal", size));
  }
  Eigen::VectorXd diagonal(size);
  for (Eigen::Index i = 0; i < size; ++i) {
    diagonal[i] = read_plain_number(node->items[i], what);
  }
  return diagonal.asDiagonal();
}

struct Structure {
  const char* name;
  Domain domain;
};
constexpr Structure kStructures[] = {{"full", Domain::positive_definite},
                                     {"diagonal", Domain::diagonal},
                                     {"scaled-identity", Domain::scaled_identity}};

// Are entries (i, j) and (j, i) the same number or sum of multiples of parameters?
bool same_multiples(const ParametrisedMatrix& matrix, Eigen::Index i, Eigen::Index j) {
  if (matrix.constant(i, j) != matrix.constant(j, i)) return false;
  std::map<int, double> difference;
  const auto is = [](const auto& e, Eigen::Index row, Eigen::Index col) {
    return e.row == row && e.col == col;
  };
  for (const ParametrisedMatrix::Entry& e : matrix.entries) {
    if (is(e, i, j)) difference[e.parameter] += e.factor;
    if (is(e, j, i)) difference[e.parameter] -= e.factor;
  }
  for (const ParametrisedMatrix::Formula& f : matrix.formulas) {
    if (is(f, i, j) || is(f, j, i)) return false;
  }
  return std::all_of(difference.begin(), difference.end(),
                     [](const auto& each) { return each.second == 0.0; });
}

// Numbers of both sides that differ by rounding alone are both their mean.
void symmetrise_rounding(ParametrisedMatrix& matrix) {
  constexpr double kRounding = 1e-9;
  const auto is_number = [&](Eigen::Index i, Eigen::Index j) {
    const auto here = [&](const auto& e) { return e.row == i && e.col == j; };
    return std::none_of(matrix.entries.begin(), matrix.entries.end(), here) &&
           std::none_of(matrix.formulas.begin(), matrix.formulas.end(), here);
  };
  for (Eigen::Index i = 0; i < matrix.constant.rows(); ++i) {
    for (Eigen::Index j = 0; j < i; ++j) {
      double &a = matrix.constant(i, j), &b = matrix.constant(j, i);
      if (!is_number(i, j) || !is_number(j, i)) continue;
      if (std::abs(a - b) <= kRounding * std::max(std::abs(a), std::abs(b))) a = b = 0.5 * (a + b);
    }
  }
}

// Throws where a covariance is not symmetric or a variance is negative; bounds parameters that are
// variances.
void check_covariance(const Grid& grid, const Entries& entries, const std::string& name,
                      NamedParameters& parameters) {
  const ParametrisedMatrix& matrix = entries.matrix;
  const Eigen::Index size = matrix.constant.rows();
  for (Eigen::Index i = 0; i < size; ++i) {
    const auto& row = grid[i];
    const auto node = [&](Eigen::Index r, Eigen::Index c) { return entries.nodes[r * size + c]; };
    for (Eigen::Index j = 0; j < i; ++j) {
      if (node(i, j) == node(j, i) || same_multiples(matrix, i, j)) continue;
      throw InputError(row[j]->at,
                       fmt::format("{} is not symmetric: {} in row {}, column {} and {} across",
                                   name, describe(*row[j]), i + 1, j + 1, describe(*grid[j][i])),
                       "the same entry on both sides");
    }
    // A variance that is one parameter's alone bounds it; a sum may stay positive in other ways.
    const auto here = [i](const auto& e) { return e.row == i && e.col == i; };
    if (std::any_of(matrix.formulas.begin(), matrix.formulas.end(), here)) continue;
    std::vector<ParametrisedMatrix::Entry> variance;
    std::copy_if(matrix.entries.begin(), matrix.entries.end(), std::back_inserter(variance), here);
    const YamlNode& entry = *row[i];
    const double fixed = matrix.constant(i, i);
    if (fixed < 0.0 ? variance.empty()
                    : fixed == 0.0 && variance.size() == 1 && variance.front().factor < 0.0) {
      throw InputError(entry.at,
                       fmt::format("variance {} in {} is negative", describe(entry), name));
    }
    if (variance.size() == 1 && fixed == 0.0) {
      bound_at_zero(parameters, variance.front().parameter, "a variance in " + name);
    }
  }
}

}  // namespace

void check_name(const YamlNode& name, const std::string& what) {
  if (is_reserved_word(name.text)) {
    throw InputError(name.at, fmt::format("{} is {}, a word of formulas", what, describe(name)),
                     "another name");
  }
  if (!is_name(name.text)) {
    throw InputError(name.at, fmt::format("{} is {}", what, describe(name)),
                     "letters, digits and '_', beginning with a letter");
  }
}

std::vector<std::string> NamedParameters::symbols() const {
  std::vector<std::string> out = names;
  out.insert(out.end(), moving.begin(), moving.end());
  return out;
}

SymbolPlaces NamedParameters::places() const {
  SymbolPlaces out;
  out.parameters = out.first_input = static_cast<int>(names.size());
  if (moving.empty()) return out;
  out.inputs = static_cast<int>(moving.size()) - 1;
  out.time = out.first_input + out.inputs;
  return out;
}

void let_move(NamedParameters& parameters, const std::vector<ChannelSource>& inputs) {
  const auto add = [&](const std::string& name) {
    const auto& taken = parameters.names;
    const bool is_parameter = std::find(taken.begin(), taken.end(), name) != taken.end();
    parameters.moving.push_back(is_parameter ? "" : name);
  };
  for (const ChannelSource& input : inputs) add(input.name);
  add("t");
}

FormulaGraph graph_of(const NamedParameters& parameters) {
  std::vector<bool> held(parameters.names.size(), true);
  held.resize(held.size() + parameters.moving.size(), false);
  return FormulaGraph(std::move(held));
}

std::vector<FormulaGraph::Id> symbols_of(FormulaGraph& graph) {
  std::vector<FormulaGraph::Id> out;
  for (std::size_t i = 0; i < graph.symbols(); ++i)
    out.push_back(graph.symbol(static_cast<int>(i)));
  return out;
}

NamedParameters read_named_parameters(const YamlNode& root) {
  NamedParameters out;
  out.declared = find(root, "parameters");
  if (out.declared == nullptr) return out;
  check_mapping(*out.declared, "parameters");
  for (std::size_t i = 0; i < out.declared->keys.size(); ++i) {
    const YamlNode& key = out.declared->keys[i];
    check_name(key, "a parameter name");
    out.set.push_back(read_parameter(key.text, out.declared->items[i], nullptr));
    out.names.push_back(key.text);
  }
  out.used.assign(out.set.size(), false);
  return out;
}

void refuse_unused(const NamedParameters& parameters) {
  for (std::size_t i = 0; i < parameters.used.size(); ++i) {
    if (parameters.used[i]) continue;
    throw InputError(parameters.declared->keys[i].at,
                     fmt::format("parameter '{}' is not used anywhere", parameters.names[i]));
  }
}

Expression read_formula(const YamlNode& node, const std::string& what,
                        const std::vector<std::string>& symbols, int first,
                        NamedParameters& parameters, FormulaKind kind) {
  Expression out;
  try {
    out = parse_expression(text_of(node, what), symbols, kind);
  } catch (const FormulaError& error) {
    throw error.in_file(place_in(node, error.column()));
  }
  for (const Expression::Node& each : out.nodes) {
    const auto index = static_cast<std::size_t>(each.symbol - first);
    if (each.op == Op::symbol && each.symbol >= first && index < parameters.used.size()) {
      parameters.used[index] = true;
    }
  }
  return out;
}

void bound_at_zero(NamedParameters& parameters, int index, const std::string& is_what) {
  Parameter& parameter = parameters.set[index];
  const YamlNode& declared = *find(*parameters.declared, parameter.name);
  const std::string what = fmt::format("parameter '{}' is {}", parameter.name, is_what);
  if (parameter.scalar() < 0.0) {
    throw InputError(part_or_whole(declared, "value").at, what + " and its value is negative");
  }
  if (find(declared, "min") != nullptr && parameter.min < 0.0) {
    throw InputError(part_or_whole(declared, "min").at, what + " and its min is negative",
                     "min: 0 or above");
  }
  parameter.min = std::max(parameter.min, 0.0);
  if (parameter.min >= parameter.max) {
    throw InputError(part_or_whole(declared, "max").at, what, "a max above 0");
  }
}

ParametrisedMatrix read_matrix(const YamlNode& node, const std::string& name,
                               const MatrixShape& want, NamedParameters& parameters,
                               LinearModel& model) {
  const Grid grid = read_grid(node, name);
  check_shape(grid, node, name, want);
  return read_entries(grid, name, parameters, model).matrix;
}

ParametrisedMatrix read_column(const YamlNode& list, const std::string& name, Eigen::Index size,
                               NamedParameters& parameters, LinearModel& model) {
  if (list.kind != YamlNode::Kind::list || static_cast<Eigen::Index>(list.items.size()) != size) {
    throw InputError(list.at,
                     list.kind == YamlNode::Kind::list
                         ? fmt::format("{} has length {}", name, list.items.size())
                         : fmt::format("{} is {}", name, describe(list)),
                     fmt::format("a list of {}, one per state", size));
  }
  Grid column;
  for (const YamlNode& entry : list.items) column.push_back({&entry});
  return read_entries(column, name, parameters, model).matrix;
}

ParametrisedMatrix read_covariance(const YamlNode& node, const std::string& name,
                                   const MatrixShape& want, NamedParameters& parameters,
                                   LinearModel& model) {
  const Grid grid = read_grid(node, name);
  check_shape(grid, node, name, want);
  Entries entries = read_entries(grid, name, parameters, model);
  symmetrise_rounding(entries.matrix);
  check_covariance(grid, entries, name, parameters);
  return std::move(entries.matrix);
}

ParametrisedMatrix read_noise_covariance(const YamlNode& node, const std::string& name,
                                         const MatrixShape& want, NamedParameters& parameters,
                                         LinearModel& model) {
  if (node.kind != YamlNode::Kind::mapping) {
    return read_covariance(node, name, want, parameters, model);
  }
  check_keys(node, name, {"structure", "start", "fixed", "prior"});
  const std::string& structure =
      word_of(required(node, "structure", name, "structure: full, diagonal or scaled-identity"),
              "structure", names_of(kStructures));
  Parameter parameter;
  parameter.name = name;
  parameter.domain =
      std::find_if(std::begin(kStructures), std::end(kStructures), [&](const Structure& s) {
        return s.name == structure;
      })->domain;
  if (const YamlNode* fixed = find(node, "fixed")) {
    parameter.fixed = word_of(*fixed, "fixed", {"true", "false"}) == "true";
  }
  if (const YamlNode* prior = find(node, "prior")) {
    parameter.prior = read_prior(*prior, "", "the variances of " + name);
  }
  parameter.value = read_start(find(node, "start"), name, want.rows, want.sides);
  const YamlNode& start = part_or_whole(node, "start");
  if (const std::string fault = domain_fault(parameter); !fault.empty()) {
    throw InputError(start.at, fmt::format("start of {} {}", name, fault));
  }
  if (std::find(parameters.names.begin(), parameters.names.end(), name) != parameters.names.end()) {
    throw InputError(find(*parameters.declared, name)->at,
                     fmt::format("parameter '{0}' has the name of the matrix {0}", name), "",
                     "rename it");
  }
  ParametrisedMatrix out;
  out.block = static_cast<int>(parameters.set.size());
  parameters.set.push_back(std::move(parameter));
  return out;
}

std::string domain_fault(const Parameter& parameter) {
  const Eigen::MatrixXd& value = parameter.value;
  if (value != value.transpose()) return "is not symmetric";
  const Eigen::MatrixXd diagonal = value.diagonal().asDiagonal();
  if (parameter.domain != Domain::positive_definite && value != diagonal) return "is not diagonal";
  if (parameter.domain == Domain::scaled_identity &&
      (value.diagonal().array() != value(0, 0)).any()) {
    return "is not a multiple of the identity";
  }
  if (!is_semidefinite(value)) return "is not positive semidefinite";
  // Its coordinates are a factor L of L L'; where L is singular, the gradient vanishes.
  if (parameter.domain == Domain::positive_definite && !parameter.fixed &&
      !(smallest_eigenvalue(value) > 0.0)) {
    return "is singular, and a free full matrix cannot start there";
  }
  return "";
}

namespace {

// What has become of numbers that are not all finite.
std::string not_finite(const Eigen::MatrixXd& value) {
  return value.hasNaN() ? "is not a number: a formula is undefined at these values"
                        : "is too large";
}

}  // namespace

std::optional<ModelFault> fault_at(const LinearModel& model, const ParameterSet& parameters) {
  const StateSpace at = instantiate(model, parameters);
  const bool moves_motion = moves(model.A) || moves(model.B) || moves(model.G);
  for (const auto& [key, value, moved] :
       {std::tuple{"A", &at.A, moves_motion}, std::tuple{"B", &at.B, moves_motion},
        std::tuple{"C", &at.C, moves(model.C)}, std::tuple{"D", &at.D, moves(model.D)},
        std::tuple{"G", &at.G, moves_motion}, std::tuple{"S", &at.S, moves(model.S)}}) {
    if (!moved && !value->allFinite())
      return ModelFault{key, fmt::format("{} {}", key, not_finite(*value))};
  }
  if (!at.x0.allFinite()) {
    return ModelFault{"initial", "the initial mean " + not_finite(at.x0)};
  }
  const auto check = [](const char* key, const std::string& what, const Eigen::MatrixXd& value) {
    std::optional<ModelFault> out;
    if (!value.allFinite()) {
      out = {key, what + " " + not_finite(value)};
    } else if (!is_semidefinite(value)) {
      out = {key, what + " is not positive semidefinite"};
    }
    return out;
  };
  // What changes from sample to sample is judged there, by the filter.
  std::optional<ModelFault> fault;
  if (!moves(model.Q)) fault = check("Q", "Q", at.Q);
  if (!fault && !moves(model.R)) fault = check("R", "R", at.R);
  if (!fault && model.initial == InitialState::given) {
    fault = check("initial", "the initial covariance", at.P0);
  }
  const bool joint_moves = moves(model.Q) || moves(model.R) || moves(model.S);
  if (!fault && !joint_moves && !at.S.isZero(0.0)) {
    fault = check("S", "the joint covariance of Q, R and S", joint_covariance(at));
  }
  return fault;
}

}  // namespace identikal
