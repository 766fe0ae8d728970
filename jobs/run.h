// What does every verb end with? Result files, text or JSON, an exit code.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
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

/// The job stops with the best so far after this many seconds; 0: whenever it is done.
void limit_time(Call& call, std::int64_t seconds);

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

/// A result that lives as long as somebody may ask for its JSON.
struct KeptResult {
  std::shared_ptr<Estimate> core;
  ResultSections sections;
  std::shared_ptr<const ModelSource> model_file = {};  ///< that of the sections

  void take(ModelSource file);
};

template <typename Result>
KeptResult kept(const std::shared_ptr<Result>& result) {
  return {result, sections_of(*result)};
}

/// Completes the estimate by the notes of the recordings, writes what the options ask for, and
/// gives what is to be printed.
/// @param more_files  of the folder, in addition to those of every result
/// @throws InputError, OutputError as write_files()
Outcome finish(const Run& run, const Recordings& recordings, KeptResult result,
               const std::vector<ResultFile>& more_files = {});

/// The result as JSON, the text that the call wants, message and exit code.
Outcome outcome_of(const Run& run, KeptResult result);

/// Measured and predicted outputs, a row per sample: "time" [s], "measured", "predicted" in the
/// channels' units, "innovations" (their difference), "standardised".
void add_series(const Series& series, Outcome& out);

}  // namespace identikal
