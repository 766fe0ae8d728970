// Do published experiments on noise estimation reproduce, and how far from the bound were they?
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "studies/figure.h"

namespace identikal {

struct StudyOptions {
  int runs = 0;            ///< repetitions of each line; 0 = as many as published
  std::uint64_t seed = 1;  ///< of the simulated recordings
  int threads = 0;         ///< that share the repetitions; 0 = as many as there are cores
  std::function<void(int done, int of)> progress;  ///< one call at a time, from any thread
};

struct StudyReport {
  std::string text;              ///< published numbers and ours
  std::string csv;               ///< what the figure shows, when there is one
  std::optional<Figure> figure;  ///< where a figure was published
};

/// One published table or figure.
struct Study {
  std::string name;
  int published_runs;                                   ///< 0: nothing is repeated
  std::function<StudyReport(const StudyOptions&)> run;  ///< options.runs > 0 where it repeats
};

/// Names that study() knows.
std::vector<std::string> study_names();

/// The same for people: "matisko-table-1 to 13, ...".
std::string study_ranges();

/// Reruns what was published under that name (studies/tables.h, studies/figures.h). The same
/// for the same seed, whatever the number of threads.
/// @throws InputError for a name that study_names() does not hold, and for a number of runs where
///   nothing is repeated
StudyReport study(const std::string& name, const StudyOptions& options = {});

}  // namespace identikal
