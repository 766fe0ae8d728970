// Where do searches for the likeliest simulation begin, and which of them lead to the same place?
#pragma once

#include <optional>
#include <vector>

#include "identify/filter/recordings_likelihood.h"
#include "identify/noise/internal/covariance_factors.h"
#include "identify/noise/ml.h"

namespace identikal {

struct ShotStarts {
  std::vector<Eigen::VectorXd> places;  ///< coordinates of the factors; the best first
  std::vector<int> place_of_start;      ///< -1: none of these, since it is far from the best
  std::vector<double> behind;           ///< of each start: log-likelihood below the best's, about
  std::vector<bool> converged;          ///< of each start
  int by_path = 0;                      ///< starts that multiple shooting has led to the best place
  std::size_t stages = 0;               ///< of its path there, of the first of them
  int iterations = 0, evaluations = 0;
  bool stopped = false;  ///< by the caller
};

/// What shoot() (identify/shooting/shooting.h) makes of the file's values and of others: each start the
/// best of many that are scattered about them. Nothing where the model is no simulation of formulas.
std::optional<ShotStarts> shot_starts(const RecordingsLikelihood& likelihood,
                                      const ParameterSet& parameters,
                                      const FactorCoordinates& factors, int starts,
                                      const NoiseMlOptions& options);

}  // namespace identikal
