// What does C get from a verb? Arguments become inputs and options, what comes out a result.
#pragma once

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "interface/identikal.h"
#include "jobs/verb.h"

/// What ik_run() gives, and what it takes to run again for the page.
struct ik_result {
  int code = 5;
  std::string message, page;
  identikal::Outcome outcome;
  identikal::Inputs inputs;
  std::string verb, options;
  std::vector<std::string> models;            ///< their names, in memory or of files
  std::vector<std::string> files;             ///< recordings in files
  std::string input_columns, output_columns;  ///< of the verb `model`, with recordings in memory
};

namespace identikal {

/// The names that models, recordings and results of a program have in messages and results.
std::string model_name_in_memory(std::size_t index = 0);
std::string recording_name_in_memory(std::size_t index);
std::string result_name_in_memory(std::size_t index);

/// A model file: its text, or where it lies.
struct GivenModel {
  std::string text, file;
};

/// What a verb is run on, none of it checked: the arguments of ik_run(), and what lies in files.
struct Arguments {
  std::vector<GivenModel> models;  ///< one, or several that are compared
  const ik_recording* recordings = nullptr;
  std::size_t count = 0;
  const ik_result* const* previous = nullptr;
  std::size_t previous_count = 0;
  std::vector<std::string> files = {};  ///< recordings behind those in memory, as DATA
};

using Progress = std::function<bool(const std::string& what, double share, double value)>;
using GoesOn = std::function<bool()>;

/// Runs result.verb with result.options. @throws InputError and others, which guarded() turns into a code
/// @param goes_on  asked instead of `progress` where nobody reads what is done; false: stop
void run(ik_result& result, const Arguments& given, const Progress& progress,
         const GoesOn& goes_on = {});

/// What does not depend on the recording: is there such a verb, does it take these options, are these models?
/// @param models  text and path of each, one of them empty; @throws InputError
void check_call(const std::string& verb,
                const std::vector<std::pair<std::string, std::string>>& models,
                const std::string& options);

/// Draws the page, unless there is one. @throws as run()
void draw_page(ik_result& result);

/// Does the work, and turns what it throws into the code and message of the command line.
void guarded(ik_result& result, const std::function<void()>& work) noexcept;

}  // namespace identikal
