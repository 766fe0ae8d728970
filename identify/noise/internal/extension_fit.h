// A model with a further part, fitted: what may be added to it, and how likely does that make the
// recordings?
#pragma once

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
/// run or the recordings do not determine them. @return the log-likelihood
std::optional<double> fit_values(Model& model, const std::vector<Dataset>& recordings);

/// The extensions that there are: a bias and an error that lasts of each output, where they are few,
/// and of all of them; errors that last, alike, of outputs whose noise is written with the same
/// variance; process noise of states without any. Their sizes begin at half of the innovations'.
/// Nothing where the filter does not run.
std::vector<ModelExtension> possible_extensions(const YamlNode& root, const Model& model,
                                                const std::vector<Dataset>& recordings);

/// The model with one more part, fitted from the values of `base`; nothing where it does not go
/// with it, or the recordings do not determine it.
std::optional<FittedModel> fit_extension(const FittedModel& base, const ModelExtension& extension,
                                         const std::vector<Dataset>& recordings);

}  // namespace identikal
