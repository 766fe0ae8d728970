// Model files and recordings drawn at random, with what a brute-force joint Gaussian says of them.
#pragma once

#include <cstdint>
#include <string>

namespace identikal {

struct RandomModelFile {
  std::string words;  ///< what it is like: "continuous, formulas, 3 states, ..."
  std::string yaml, csv;
  /// Of the recording, by the density of all samples at once, computed from matrices in SI that
  /// were never written to the file: units, formulas, sampling and the filter have no part in it.
  double log_likelihood = 0.0;
};

/// One to four states, one or two outputs, none to two inputs; matrices or formulas (of states with
/// units, in continuous time); discrete or sampled, inputs held or straight between samples; the
/// start stationary, given or diffuse; channels with units, scales and offsets, and samples that
/// are missing; parameters with units. A function of the seed alone.
RandomModelFile draw_model_file(std::uint64_t seed);

/// The program's own log-likelihood of the recording, through file, units, formulas and filter.
double log_likelihood_of(const RandomModelFile& drawn);

}  // namespace identikal
