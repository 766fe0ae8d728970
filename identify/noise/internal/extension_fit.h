// A model with a further part, fitted: what may be added to it, and how likely does that make the
// recordings?
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
/// run or the recordings do not determine them, or the score where they are promises less.
/// @param least_gain  [nats]; 0: whatever it promises
/// @return the log-likelihood
std::optional<double> fit_values(Model& model, const std::vector<Dataset>& recordings,
                                 double least_gain = 0.0);

/// The extensions that there are: a bias and an error that lasts of each output, where they are
/// few, and of all of them; errors that last, alike, of outputs whose noise is written with the
/// same variance; a scale and, in continuous time, a delay of each; bias, scale and lasting error
/// of each input, where they are few; process noise of states without any, and coloured process
/// noise of those that have some. Their sizes begin at half of the innovations'. And of one
/// recording, whose innovations change their size: measurement noise, or process noise, that
/// changes where they do. Nothing where the filter does not run.
std::vector<ModelExtension> possible_extensions(const YamlNode& root, const Model& model,
                                                const std::vector<Dataset>& recordings);

/// The model with one more part, fitted from the values of `base`; nothing where it does not go
/// with it, or the recordings do not determine it. `base` is at its maximum.
/// @param least_gain  a bias, scale or delay whose score promises less is not fitted [nats]
std::optional<FittedModel> fit_extension(const FittedModel& base, const ModelExtension& extension,
                                         const std::vector<Dataset>& recordings,
                                         double least_gain = 0.0);

/// The same of each, some at a time; what comes out does not depend on how many.
/// @param threads   0: as many as there are cores
/// @param progress  told of each as it begins; where it returns false no further one begins, and
///   those have nothing. Empty: nobody is told
std::vector<std::optional<FittedModel>> fit_extensions(
    const FittedModel& base, const std::vector<ModelExtension>& extensions,
    const std::vector<Dataset>& recordings, int threads,
    const std::function<bool(const ModelExtension& extension)>& progress, double least_gain = 0.0);

}  // namespace identikal
