// What is unknown, where it may lie, and how an optimiser moves it.
#pragma once

#include <limits>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "lib/base/alignment.h"

namespace identikal {

/// What values a parameter may take, and so which coordinates an optimiser moves it by.
enum class Domain {
  scalar,             ///< one number in [min, max]; its own coordinate
  diagonal,           ///< covariance with free diagonal >= 0; the diagonal is the coordinate vector
  scaled_identity,    ///< q I with q >= 0; q is the coordinate
  positive_definite,  ///< covariance L L'; the lower triangle of L, column by column, is the
                      ///< coordinate vector
};

/// What is known of a number before the data: of a scalar, or of each variance of a covariance
/// matrix.
struct Prior {
  enum class Kind {
    none,
    uniform,      ///< between a and b
    log_uniform,  ///< its logarithm between those of a and b
    normal,       ///< mean a, standard deviation b
    log_normal,   ///< median a, and a factor b up or down is one standard deviation
  };
  Kind kind = Kind::none;
  double a = 0.0, b = 0.0;  ///< SI
};

/// By what a search moves a number.
enum class SearchScale {
  automatic,  ///< its logarithm where it has two bounds above zero: it may be decades off
  linear,     ///< itself
  logarithm,
};

/// Where a parameter has a value: a model may say that some differ from recording to recording
/// (identify/model/own_parameters.h).
enum class Scope {
  everywhere,
  recording,  ///< in the recordings whose own it is, in place of the model's
  replaced,   ///< nowhere: every recording has its own. It is not reported
};

/// A named unknown (or known, when fixed) number or covariance matrix, in SI.
///
/// Example:
///
///     const Parameter q{.name = "q", .value = Eigen::MatrixXd::Constant(1, 1, 2.0), .min = 0.0};
///     const Eigen::VectorXd x = coordinates({q});  // what an optimiser moves
///     const ParameterSet moved = with_coordinates({q}, 1.1 * x);
struct Parameter {
  std::string name;
  std::string unit;       ///< the user's unit, for printing; the value is SI
  Eigen::MatrixXd value;  ///< 1 x 1 for a scalar
  Domain domain = Domain::scalar;
  double min = -std::numeric_limits<double>::infinity();  ///< SI; scalars only
  double max = std::numeric_limits<double>::infinity();   ///< SI; scalars only
  bool fixed = false;
  Prior prior;
  Scope scope = Scope::everywhere;
  SearchScale scale = SearchScale::automatic;

  double scalar() const { return value(0, 0); }
};
using ParameterSet = std::vector<Parameter>;

/// Position of the parameter of that name, or -1.
int find_parameter(const ParameterSet& parameters, const std::string& name);

/// Does a search of equations that are not linear move it by its logarithm?
bool moves_by_logarithm(const Parameter& parameter);

/// Box of an optimiser's coordinates; +-infinity where there is no bound.
struct Box {
  Eigen::VectorXd lower, upper;
};

/// Coordinates of the free parameters, in the order of the set.
Eigen::VectorXd coordinates(const ParameterSet& parameters);
Box coordinate_box(const ParameterSet& parameters);

/// The set with its free parameters moved to `coordinate`. Scalars are taken as they are: a caller
/// that leaves the box gets values outside it. @throws std::invalid_argument when the number of
/// coordinates differs.
ParameterSet with_coordinates(ParameterSet parameters, const Eigen::VectorXd& coordinate);

/// The free parameters' distinct entries: themselves for scalars, q of q I, the diagonal, the lower
/// triangle column by column. As many as there are coordinates, and the same but for
/// Domain::positive_definite.
Eigen::VectorXd free_entries(const ParameterSet& parameters);
/// Of a square matrix, column by column: the distinct entries of a symmetric one.
Eigen::VectorXd lower_triangle(const Eigen::MatrixXd& M);
/// The set with its free parameters' entries as given. @throws std::invalid_argument when their
/// number differs.
ParameterSet with_entries(ParameterSet parameters, const Eigen::VectorXd& entries);

/// Derivative of one parameter's value with respect to one free entry; a constant.
struct EntryDerivative {
  int parameter;          ///< index into the set
  Eigen::MatrixXd value;  ///< d value / d entry, shape of the parameter's value, symmetric
};
/// One per free entry, in the order of free_entries().
std::vector<EntryDerivative> entry_derivatives(const ParameterSet& parameters);

/// d entries / d coordinates at `coordinate`, square.
Eigen::MatrixXd entry_jacobian(const ParameterSet& parameters, const Eigen::VectorXd& coordinate);

/// The positive semidefinite part of -sum_e g_e d^2 entry_e / d coordinate^2: what a function with
/// the entry gradient g loses by the curvature of the coordinates. Near the boundary of
/// definiteness it is all the curvature there is. Zero but for Domain::positive_definite. g by the
/// order of free_entries().
Eigen::MatrixXd coordinate_curvature(const ParameterSet& parameters,
                                     const Eigen::VectorXd& entry_gradient);

/// The numbers a person reads: every scalar, and every distinct entry of every matrix ("Q(2,1)").
/// Those of free parameters are free_entries(). Replaced ones are left out.
struct ReportedEntries {
  std::vector<std::string> names, units;
  std::vector<int> parameter;  ///< which parameter each entry belongs to
  std::vector<bool> variance;  ///< cannot be negative
  Eigen::VectorXd value;
};
ReportedEntries reported_entries(const ParameterSet& parameters);

}  // namespace identikal
