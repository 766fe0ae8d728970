// Do published experiments on noise estimation reproduce, and how far from the bound were they?
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace identikal {

struct StudyOptions {
  int runs = 50;           ///< repetitions of each line, as published
  std::uint64_t seed = 1;  ///< of the simulated recordings
  std::function<void(int done, int of)> progress;
};

/// Names that study() knows.
std::vector<std::string> study_names();

/// Reruns a table of Matisko (2013), chapter 4, on recordings of our own and prints, for every
/// line, mean and standard deviation of the estimates as published, by the published method as we
/// implement it from its description, by maximum likelihood, and the Cramér-Rao bound from outputs
/// alone, which the standard deviation of an unbiased method cannot go below.
/// @throws InputError for a name that study_names() does not hold
std::string study(const std::string& name, const StudyOptions& options = {});

}  // namespace identikal
