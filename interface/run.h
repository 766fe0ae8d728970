// What does C get from a verb? Arguments become inputs and options, what comes out a result.
#pragma once

#include <functional>
#include <string>

#include "interface/identikal.h"
#include "jobs/verb.h"

/// What ik_run() gives, and what it takes to run again for the page.
struct ik_result {
  int code = 5;
  std::string message, page;
  identikal::Outcome outcome;
  identikal::Inputs inputs;
  std::string verb, options;
};

namespace identikal {

/// The names that models, recordings and results of a program have in messages and results.
std::string model_name_in_memory();
std::string recording_name_in_memory(std::size_t index);
std::string result_name_in_memory(std::size_t index);

/// Does the work, and turns what it throws into the code and message of the command line.
void guarded(ik_result& result, const std::function<void()>& work) noexcept;

}  // namespace identikal
