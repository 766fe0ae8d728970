// How far is a filter's noise from the likeliest, all entries at once, and what does staying cost?
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "identify/model/model.h"
#include "identify/optimality/score_statistic.h"
#include "lib/data/dataset.h"
#include "lib/filter/recording_digest.h"

namespace identikal {

/// A parameter, or several that gain together what none of them gains alone.
struct NoiseGain {
  std::vector<std::string> what;  ///< "r = 0.0529 in place of 0.01", the user's units
  double gain = 0.0;              ///< of the log-likelihood [nats]
};

/// From the present noise to the likeliest, one parameter after the other, always the one that gains
/// most: log L(S and i) - log L(S), where the parameters of S have their likeliest values already
/// and the others stay. The gains add up to the whole.
///
/// Example:
///
///     const Model freed = with_free_noise(model);
///     const Retuned better = retuned(freed, recordings);
///     for (const NoiseGain& each : changes_in_order(freed, better.parameters, recordings))
///       std::printf("%s gains %g\n", each.what.front().c_str(), each.gain);
///
/// @param model   as with_free_noise() returns it; @param better  likelier values of its parameters
/// @return empty where the likelihood does not exist between the two
std::vector<NoiseGain> changes_in_order(const Model& model, const ParameterSet& better,
                                        const std::vector<Dataset>& recordings);
/// The same of recordings that are no longer there.
std::vector<NoiseGain> changes_in_order(const Model& model, const ParameterSet& better,
                                        const std::vector<RecordingDigest>& digests);

/// By how much the mean-square errors of filtered states are above those of the likelier filter:
///
///   sum_t (x_present - x_better)_i^2 / sum_t P_better,ii,
///
/// as the error of an optimal filter is uncorrelated with all functions of its data, the other
/// filter's estimate among them. Of a model of any kind; rows of a diffuse start do not count.
struct StateExcess {
  Eigen::VectorXd of_state;  ///< n, of filtered states; NaN where one is known exactly
  double of_all = 0.0;       ///< of all, one step ahead, as tr P has it
};

/// @return empty vectors and NaN where a filter does not run
StateExcess state_excess(const Model& model, const ParameterSet& better,
                         const std::vector<Dataset>& recordings);

/// Both in sentences, for a person. @param gain  the whole
std::string in_order(const std::vector<NoiseGain>& changes);
std::string in_words(const StateExcess& excess, const Model& model);

}  // namespace identikal
