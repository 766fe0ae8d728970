// What is a verb: tune, fit, check, ...? Its options, what it does with them, and what comes out.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "jobs/inputs.h"
#include "jobs/late_text.h"
#include "jobs/options.h"
#include <Eigen/Core>

#include "identify/estimate/estimate.h"
#include "identify/estimate/none.h"
#include "identify/estimate/recording_fit.h"
#include "identify/filter/likelihood_team.h"

namespace identikal {

/// Numbers of a result beyond its JSON: a row per sample.
struct NamedSeries {
  std::string name;
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> values;
};

struct TrackSettings;  // jobs/track_settings.h

/// What whoever calls a verb hands over beside its options.
struct Call {
  Inputs inputs;
  /// Processes that share the recordings, where the verb estimates by likelihood; null: this one alone.
  const LikelihoodTeam* team = nullptr;
  std::string command;  ///< the command line as typed, for the page
  /// Called while it works. @return false to stop with the best so far
  std::function<bool(const std::string& what, double share, double value)> progress;
  /// Asked instead of it where nobody reads what is done. @return false to stop with the best so far
  std::function<bool()> goes_on;
  /// From here on progress is reported in vain: the job stops with the best so far.
  std::chrono::steady_clock::time_point deadline = std::chrono::steady_clock::time_point::max();
  /// Told that the job does not report progress from here on, and that it is to end after so many
  /// seconds, if above zero. Empty: nobody can end it.
  std::function<void(std::int64_t seconds)> unattended;
  bool wants_series = false, wants_page = false;
  bool wants_text = true;                               ///< else a result has no Outcome::text
  std::function<void(const std::string& line)> notice;  ///< takes remarks on how it was called
  /// Takes text that is too long for Outcome::text piece by piece; empty: nobody does.
  std::function<void(const std::string& text)> print;
};

/// Neither beyond the deadline nor asked to stop.
bool may_go_on(const Call& call);

/// @param share  of the work that is done, @param value  of the objective; kNone: not known
/// @return false when the caller wants to stop
bool report_progress(const Call& call, const std::string& what, double share = kNone,
                     double value = kNone);

struct Outcome {
  int exit_code = 0;
  std::string text;                          ///< for people, or JSON where the options ask for it
  LateText json;                             ///< the result, of verbs that have one
  LateText summary;                          ///< the same for people
  std::shared_ptr<const Estimate> estimate;  ///< the same as values, of most verbs
  std::shared_ptr<const RecordingFit> fit;   ///< fits and tests of it, where it has some
  std::string page_data;            ///< what the page draws beyond it (identify/report/page_data.h)
  std::string message;              ///< of a result, its status and why: "ok: converged"
  std::vector<NamedSeries> series;  ///< where the call asks for them
  /// Of the verb track, for those models that can be tracked sample by sample; else null.
  std::shared_ptr<const TrackSettings> track;
};

struct Verb {
  std::string name;
  std::string help;         ///< a sentence
  std::string footer = {};  ///< of the help, below the options
  std::vector<Option> options = {};
  /// Works with the options that were taken. Files that they name are written, all or none.
  /// @throws InputError for a mistake in options, model or data, OutputError where a result cannot
  ///   be written
  std::function<Outcome(Call& call)> run = {};
};

}  // namespace identikal
