// Where do searches for the greatest likelihood end that begin at several places?
#pragma once

#include <limits>
#include <string>
#include <vector>

#include "identify/filter/recordings_likelihood.h"
#include "identify/noise/internal/covariance_factors.h"
#include "identify/noise/internal/root_coordinates.h"
#include "identify/noise/ml.h"

namespace identikal {

/// Where one of them ended.
enum class SearchEnd {
  best,     ///< at the greatest likelihood that was found, or within its tolerance
  maximum,  ///< at another maximum, where nothing in the neighbourhood is higher
  short_of  ///< where the likelihood is flat or short of a maximum
};

struct SeveralStarts {
  Solution best;                         ///< x in the coordinates of the factors
  std::vector<RootsOnCircle> on_circle;  ///< at the best
  double start_value = std::numeric_limits<double>::quiet_NaN();
  int iterations = 0, evaluations = 0;
  /// Starts that multiple shooting has led to the best (shot_starts.h), and the stages of its path.
  int by_path = 0, stages = 0;
  bool shot = false;  ///< places to begin at were looked for on integration of its own
  int undefined =
      0;  ///< starts at which the likelihood is undefined, and which are in nothing below
  /// Of each other start:
  std::vector<SearchEnd> ends;
  std::vector<double> log_likelihood;
  std::vector<std::vector<double>> paths;  ///< log-likelihood by iteration
  std::vector<Eigen::VectorXd> best_ends;  ///< where searches ended that were as high as the best

  int count(SearchEnd end) const;
};

/// Searches from the model's own values, which may be where the likelihood is undefined, and from
/// others scattered about them where options.starts says so. 0 asks for four more where the first
/// leaves a doubt; where variances alone are unknown and some may be zero, for one with each of
/// these so large that the samples tell it, and so on from a better maximum that is found there.
/// One that comes near the first one's maximum ends there.
/// @param factors  of the named covariances; options.threads searches run at a time
SeveralStarts search_from_starts(RecordingsLikelihood& likelihood, const ParameterSet& parameters,
                                 const FactorCoordinates& factors, const NoiseMlOptions& options);

/// The best again, from where it has ended, of a likelihood that has changed since by what its
/// integration makes finer. The others stay as far behind.
void search_again(SeveralStarts& found, RecordingsLikelihood& likelihood,
                  const FactorCoordinates& factors, const NoiseMlOptions& options);

/// Where the starts ended, if not all at the best. Where a search stopped short says nothing of
/// other maxima, however often it does.
Findings check_starts(const SeveralStarts& found);

/// A sentence on the starts that led nowhere; empty where there are none.
std::string undefined_starts(const SeveralStarts& found);

}  // namespace identikal
