// Which named numbers are one covariance together, and how does a search move them inside its cone?
#pragma once

#include <vector>

#include <Eigen/Core>

#include "identify/model/model.h"
#include "solvers/scoring.h"

namespace identikal {

/// Of the free entries (lib/model/parameter.h): those of one symmetric matrix.
struct CovarianceEntries {
  Eigen::Index size = 0;              ///< n of n x n
  std::vector<Eigen::Index> entries;  ///< of its lower triangle, column by column
};

/// The first free entry of each parameter.
std::vector<Eigen::Index> first_entries(const ParameterSet& parameters);

/// Blocks of Q and R whose every entry is a free number of its own that occurs nowhere else, like
/// Q: [[q11, q12], [q12, q22]]: at least 2 x 2, variances without other bounds than zero, no priors.
/// None of a model with S.
std::vector<CovarianceEntries> named_covariances(const Model& model);

/// Those, and the parameters of Domain::positive_definite.
std::vector<CovarianceEntries> all_covariances(const Model& model);

/// Coordinates in which named covariances are L L': the others are those of RecordingsLikelihood.
/// In their own they are bounded by a cone that a search in a box does not know of.
///
/// Example:
///
///     const FactorCoordinates factors(model.parameters, named_covariances(model));
///     const Solution end = maximise(factors.problem(likelihood.problem()), factors.from(start));
class FactorCoordinates {
 public:
  FactorCoordinates(const ParameterSet& parameters, const std::vector<CovarianceEntries>& named);

  /// Where named covariances are singular beyond rounding, they are taken as the nearest that are
  /// not.
  Eigen::VectorXd from(const Eigen::VectorXd& x) const;
  Eigen::VectorXd to(const Eigen::VectorXd& y) const;
  /// The coordinate that is number i of x; -1 for an entry of a named covariance.
  Eigen::Index coordinate_of(Eigen::Index i) const;
  /// @param by_entries  in x, referred to; not changed where nothing is named
  LikelihoodProblem problem(const LikelihoodProblem& by_entries) const;

 private:
  bool any_ = false;
  ParameterSet shape_;                  // a number for each other coordinate, then the matrices
  std::vector<Eigen::Index> position_;  // in x of each free entry of `shape_`
};

}  // namespace identikal
