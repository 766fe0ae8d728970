// What was typed? One verb with its options.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "jobs/verb.h"

namespace identikal {

struct CommandLine {
  Verb verb;                    ///< with its options taken
  std::string memory_limit;     ///< as limit_memory() reads it; empty: none
  std::int64_t time_limit = 0;  ///< of a verb that has no such option of its own [s]; 0: none
};

/// What the command line asks for. Nothing where that is --help, --version or --generate, which is
/// answered.
/// @throws InputError for an unknown verb or option and values that do not fit
std::optional<CommandLine> read_command_line(int argc, char** argv);

/// read_command_line(), and runs the verb.
/// @return the exit code
/// @throws InputError, OutputError
int run_command_line(int argc, char** argv);

/// The program: the same, and what it throws becomes a line on standard error and an exit code.
int run_program(int argc, char** argv) noexcept;

}  // namespace identikal
