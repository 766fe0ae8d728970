// Which of several filters predicts these recordings best?
#pragma once

#include <string>

#include "jobs/verb.h"

namespace identikal {

/// What is compared: results, or models by recordings.
struct CompareOptions {
  ModelOptions model;           ///< what all models are read with; its file stays empty
  RecordingOptions recordings;  ///< models and recordings, in any order; or results
  ResultOptions result;
};

/// Ranks the models among the files by their likelihood on the recordings among them.
/// @throws InputError
Outcome compare_models(const CompareOptions& options, Call& call);

}  // namespace identikal
