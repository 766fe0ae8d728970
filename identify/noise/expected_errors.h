// How large are the errors of a filter's states, if another model is the right one?
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "identify/estimate/results.h"
#include "identify/model/extension.h"
#include "identify/model/model.h"
#include "identify/model/yaml_reader.h"
#include "lib/data/dataset.h"

namespace identikal {

/// Of a filter's estimates x, where another filter's estimates x* are the conditional means and P*
/// their covariance: by orthogonality E |x_i - truth_i|^2 = mean (x_i - x*_i)^2 + mean P*_ii.
struct ExpectedErrors {
  std::string if_right;  ///< in words, what the other has; empty: nothing likelier was found
  /// Root-mean-square error above the other's, as a share, over all states: the mean of
  /// (x_i - x*_i)^2 / P*_ii over rows and states is its square less one.
  double excess = 0.0;
  /// The same, and what neither filter explains of the innovations, all of it errors of the states.
  double most = 0.0;
  double nees = 1.0;        ///< mean of expected squared errors over the filter's own variances
  std::string worst_state;  ///< with the largest share; empty: none
  /// In words, an estimate that is no size of the noise and would be another with the likelier model
  /// (identify/noise/internal/moved_estimates.h); else nothing.
  std::optional<std::string> moved;
};

struct ExpectedErrorsOptions {
  int threads = 1;  ///< further parts that are tried at a time; 0: as many as there are cores
  /// Told of each as it begins, by one thread at a time. @return false to try no more
  std::function<bool(const ModelExtension& extension)> progress = {};
};

/// Of the states that both have.
/// @param better  a likelier model
/// @return nothing where one of the filters does not run
std::optional<ExpectedErrors> errors_if_right(const Model& model, const Model& better,
                                              const std::vector<Dataset>& recordings);

/// What is likelier than a model that the data contradict: the possible extensions
/// (identify/noise/internal/extension_fit.h), fitted to at most 5000 rows, are compared by BIC, and
/// the same model is fitted without outliers, which both filters then see. The one that costs the
/// states most counts.
///
/// @param root   the model's file as a tree
/// @param model  at the values of `estimate`, which is of maximum likelihood
ExpectedErrors expected_errors(const YamlNode& root, const Model& model,
                               const std::vector<Dataset>& recordings,
                               const NoiseEstimate& estimate,
                               const ExpectedErrorsOptions& options = {});

/// A part as likely as the one that a model has in its place.
struct UndecidedPart {
  std::string what;
  Model model;  ///< that has it, at its values
};

/// Where one of these may be right: says what the states lose then, serious unless it is as little
/// as in judge_by_expected_errors(), and concludes again.
/// @param model  as given, its values do not count: those of the estimate do
void judge_by_undecided(const std::vector<UndecidedPart>& parts, const Model& model,
                        const std::vector<Dataset>& recordings, NoiseEstimate& estimate);

/// Whether tests of the innovations fail, and nothing that is misread explains it: then
/// judge_by_expected_errors() has something to do.
bool innovations_contradict(const NoiseEstimate& estimate);

/// Where tests of the innovations fail: adds expected_errors() to the estimate, and concludes again
/// by their size. What the innovations show is serious unless the states lose at most 3 % by it,
/// their squared errors are 2/3 to 3/2 of their variances, and no estimate but of noise would be
/// another. Nothing is added where `progress` stops the trials, nor where no noise moves the states:
/// what is asked for then are the parameters.
///
/// Example:
///
///     const YamlNode root = read_yaml("tracker.yaml");
///     NoiseEstimate tuned;  // = tune_ml(model, recordings)
///     judge_by_expected_errors(root, model, recordings, tuned);
///
/// @param model  as given, its values do not count: those of the estimate do
void judge_by_expected_errors(const YamlNode& root, const Model& model,
                              const std::vector<Dataset>& recordings, NoiseEstimate& estimate,
                              const ExpectedErrorsOptions& options = {});

}  // namespace identikal
