// What does every verb end with? A progress line while it works, result files, text or JSON, an exit
// code.
#pragma once

#include <chrono>
#include <string>
#include <vector>

#include "command/load.h"
#include "command/options.h"
#include "command/output_files.h"
#include "identify/estimate/estimate.h"

namespace identikal {

/// On standard output. @throws OutputError when it takes no more, as on a full disk
void print(const std::string& text);

/// One line that rewrites itself, on a terminal only.
class Progress {
 public:
  explicit Progress(bool quiet);
  ~Progress() { clear(); }
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;
  void show(const std::string& text);
  void clear();

 private:
  bool shown_;
  bool dirty_ = false;
};

/// The model file and those that it includes.
std::vector<std::string> model_and_included(const std::string& path);

/// A job from its begin to its result.
struct Run {
  std::string verb;
  std::string command;            ///< as typed, for the page
  std::string model;              ///< the model file; empty where there are several, or a result
  std::vector<std::string> read;  ///< other files than models and recordings
  ResultOptions options;
  std::vector<std::string> models = {};  ///< several models
  std::chrono::steady_clock::time_point begin = std::chrono::steady_clock::now();

  double seconds() const;
};

/// Are pictures worth making? A page shows them: --report's, or one that is made later of what -o
/// writes.
bool wants_pictures(const ResultOptions& options);

/// Completes the estimate by the notes of the recordings, writes what the options ask for and prints
/// the result.
/// @param more_files  of the folder, in addition to those of every result
/// @return the exit code
/// @throws InputError, OutputError as write_files()
int finish(const Run& run, const Recordings& recordings, Estimate& estimate,
           const std::vector<ResultFile>& more_files = {});

}  // namespace identikal
