// What was typed? One verb with its options.
#pragma once

namespace identikal {

/// Runs the verb that the command line names, or answers --help, --version or --generate.
/// @return the exit code
/// @throws InputError for an unknown verb or option and values that do not fit; OutputError
int run_command_line(int argc, char** argv);

/// The program: the same, and what it throws becomes a line on standard error and an exit code.
int run_program(int argc, char** argv) noexcept;

}  // namespace identikal
