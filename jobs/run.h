// What does every verb end with? Result files, text or JSON, an exit code.
#pragma once

#include <chrono>
#include <string>
#include <vector>

#include "jobs/load.h"
#include "jobs/options.h"
#include "jobs/output_files.h"
#include "jobs/verb.h"

#include "identify/estimate/results.h"

namespace identikal {

/// A remark on how a verb was called, where somebody listens.
void notice(const Call& call, const std::string& line);

/// The model file and those that it includes.
std::vector<std::string> model_and_included(const std::string& path, Inputs& inputs);

/// A job from its begin to its result.
struct Run {
  std::string verb;
  Call& call;
  std::string model;              ///< the model file; empty where there are several, or a result
  std::vector<std::string> read;  ///< other files than models and recordings
  ResultOptions options;
  std::vector<std::string> models = {};  ///< several models
  std::chrono::steady_clock::time_point begin = std::chrono::steady_clock::now();

  double seconds() const;
  /// Are pictures worth making? A page shows them: --report's, one that is made later of what -o
  /// writes, or the caller's.
  bool wants_pictures() const;
};

/// Completes the estimate by the notes of the recordings, writes what the options ask for, and
/// gives what is to be printed.
/// @param sections    of the same result
/// @param more_files  of the folder, in addition to those of every result
/// @throws InputError, OutputError as write_files()
Outcome finish(const Run& run, const Recordings& recordings, Estimate& estimate,
               ResultSections sections, const std::vector<ResultFile>& more_files = {});

/// Measured and predicted outputs, a row per sample: "time" [s], "measured", "predicted" in the
/// channels' units, "innovations" (their difference), "standardised".
void add_series(const Series& series, Outcome& out);

}  // namespace identikal
