// A model with a further part, fitted: how likely does that make the recordings?
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "identify/model/extension.h"
#include "identify/model/model.h"
#include "lib/data/dataset.h"

namespace identikal {

/// A model as its file has it, at values that were found for it.
struct FittedModel {
  YamlNode root;
  Model model;
  double log_likelihood = 0.0;
};

/// The free parameters of the model become the likeliest; nothing changes where the filter does not
/// run or the recordings do not determine them.
/// @return the log-likelihood
std::optional<double> fit_values(Model& model, const std::vector<Dataset>& recordings);

/// The first 5000 rows of all recordings together: what extensions are fitted to.
std::vector<Dataset> rows_to_fit(const std::vector<Dataset>& recordings);

/// The model with each of the further parts, fitted from the values of `base`, some at a time; what
/// comes out does not depend on how many. Nothing where a part does not go with the model, or the
/// recordings do not determine it, nor of a curve whose score promises less than half of BIC's
/// penalty.
/// @param base      at its maximum
/// @param threads   0: as many as there are cores
/// @param progress  told of each as it begins; where it returns false no further one begins, and
///   those have nothing. Empty: nobody is told
std::vector<std::optional<FittedModel>> fit_extensions(
    const FittedModel& base, const std::vector<ModelExtension>& extensions,
    const std::vector<Dataset>& recordings, int threads,
    const std::function<bool(const ModelExtension& extension)>& progress);

struct LikeliestExtension {
  std::size_t which;
  FittedModel fitted;
};

/// Of the same the one with the least BIC, if that is below that of `base`. All are searched side
/// by side, a few steps at a time, and those that can hardly reach the best any more are left; a
/// bias, scale, delay or curve whose score promises less than half of BIC's penalty is not searched
/// at all.
/// @return nothing, too, where progress() has stopped it
std::optional<LikeliestExtension> likeliest_extension(
    const FittedModel& base, const std::vector<ModelExtension>& extensions,
    const std::vector<Dataset>& recordings, int threads,
    const std::function<bool(const ModelExtension& extension)>& progress);

/// Of curves the one that the log-likelihood gains most by, of those whose score promises, and whose
/// fit gains, at least `least_gain`.
std::optional<LikeliestExtension> likeliest_curve(
    const FittedModel& base, const std::vector<ModelExtension>& curves,
    const std::vector<Dataset>& recordings, double least_gain,
    const std::function<bool(const ModelExtension& extension)>& progress);

}  // namespace identikal
