// How does a model file write matrices? As rows of numbers and formulas of named parameters, and
// covariances also as a whole that is estimated.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "identify/model/yaml_reader.h"
#include "lib/data/dataset.h"
#include "lib/formula/expression.h"
#include "lib/formula/formula_graph.h"
#include "lib/model/linear_formulas.h"
#include "lib/model/linear_model.h"
#include "lib/model/parameter.h"

namespace identikal {

/// The parameters of a model while it is read: first those that formulas may name, then the ones
/// that are whole matrices.
struct NamedParameters {
  ParameterSet set;
  const YamlNode* declared = nullptr;  ///< the mapping that the named ones come from
  std::vector<std::string> names;      ///< of the named ones
  std::vector<bool> used;              ///< whether any formula names them
  /// What matrices may hold beside parameters: the inputs' names, then the time's.
  std::vector<std::string> moving;

  /// The symbols of a matrix's formulas: parameters, inputs, the time.
  std::vector<std::string> symbols() const;
  SymbolPlaces places() const;
};
/// Formulas of matrices may hold these inputs, and the time as t, from here on.
void let_move(NamedParameters& parameters, const std::vector<ChannelSource>& inputs);

NamedParameters read_named_parameters(const YamlNode& root);

/// A graph for formulas over NamedParameters::symbols(), and the nodes of these.
FormulaGraph graph_of(const NamedParameters& parameters);
std::vector<FormulaGraph::Id> symbols_of(FormulaGraph& graph);

/// Throws at the first parameter that nothing uses.
void refuse_unused(const NamedParameters& parameters);

/// Letters, digits and '_', beginning with a letter?
bool is_name(std::string_view text);

/// A name as formulas can have them. @param what  for the message, e.g. "a parameter name"
void check_name(const YamlNode& name, const std::string& what);

/// A formula over these symbols. Marks the parameters in it as used.
/// @param first  symbol that stands for parameter 0
Expression read_formula(const YamlNode& node, const std::string& what,
                        const std::vector<std::string>& symbols, int first,
                        NamedParameters& parameters, FormulaKind kind = FormulaKind::number);

inline constexpr Eigen::Index kAnySize = -1;
/// What a matrix's size must be, and what its sides mean.
struct MatrixShape {
  Eigen::Index rows, cols;
  const char* sides;
};

/// A matrix by its entries; one alone may stand without brackets.
///
/// Example:
///
///     const YamlNode root = parse_yaml("parameters: {tau: 2}\nA: [[1 - 0.1/tau]]", "lag.yaml");
///     NamedParameters parameters = read_named_parameters(root);
///     LinearModel lag;
///     const MatrixShape square{1, 1, "states x states"};
///     lag.A = read_matrix(*find(root, "A"), "A", square, parameters, lag);
///
/// @param model  receives what is neither a number nor a sum of multiples of parameters
ParametrisedMatrix read_matrix(const YamlNode& node, const std::string& name,
                               const MatrixShape& want, NamedParameters& parameters,
                               LinearModel& model);

/// A covariance by its entries: symmetric whatever the parameters are, no negative variance. A
/// parameter that is a variance is bounded by zero.
ParametrisedMatrix read_covariance(const YamlNode& node, const std::string& name,
                                   const MatrixShape& want, NamedParameters& parameters,
                                   LinearModel& model);

/// The same, or {structure, start, fixed, prior}: the whole matrix as one parameter.
ParametrisedMatrix read_noise_covariance(const YamlNode& node, const std::string& name,
                                         const MatrixShape& want, NamedParameters& parameters,
                                         LinearModel& model);

/// A parameter that is a variance or a standard deviation stays at or above zero.
/// @param what  for the message, e.g. "a variance in Q"
void bound_at_zero(NamedParameters& parameters, int index, const std::string& what);

/// A list of formulas, one per state, as a column.
ParametrisedMatrix read_column(const YamlNode& list, const std::string& name, Eigen::Index size,
                               NamedParameters& parameters, LinearModel& model);

/// Is the value of a matrix-valued parameter one that its coordinates can reach and leave again?
/// Says what is wrong, or nothing.
std::string domain_fault(const Parameter& parameter);

/// What is wrong with a model, and the key of the file that says so.
struct ModelFault {
  std::string key, text;
};

/// The first matrix that overflows, or covariance that is not positive semidefinite, at these
/// values.
std::optional<ModelFault> fault_at(const LinearModel& model, const ParameterSet& parameters);

}  // namespace identikal
