// Which further parts could a model have, after what its filter leaves of the recordings?
#pragma once

#include <vector>

#include "identify/model/extension.h"
#include "identify/model/model.h"
#include "lib/data/dataset.h"

namespace identikal {

/// The extensions that there are: a bias and an error that lasts of each output, where they are
/// few, and of all of them; errors that last, alike, of outputs whose noise is written with the
/// same variance; a scale and, in continuous time, a delay of each; bias, scale and lasting error
/// of each input, where they are few; process noise of states without any, and coloured process
/// noise of those that have some; measurement noise of its own of each of few outputs whose noise
/// is written alike; curved_motions(). Their sizes begin at half of the innovations'. And of one
/// recording, whose innovations change their size: measurement noise, or process noise, that changes
/// where they do. Nothing where the filter does not run.
std::vector<ModelExtension> possible_extensions(const YamlNode& root, const Model& model,
                                                const std::vector<Dataset>& recordings);

/// Quadratic damping and dry friction of every state that has process noise, cubic terms of the
/// states that its motion holds, and curves of few inputs; where the start is given by its mean.
/// Nothing where the filter does not run.
std::vector<ModelExtension> curved_motions(const YamlNode& root, const Model& model,
                                           const std::vector<Dataset>& recordings);

}  // namespace identikal
