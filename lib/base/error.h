// How a mistake in a user's file, or on the command line, is reported.
#pragma once

#include <stdexcept>
#include <string>

namespace identikal {

/// A place in a user's file. `line` and `column` count from 1; 0 means "not known".
struct Location {
  std::string path;
  int line = 0;
  int column = 0;
};

/// A mistake in a file or an option that its writer can mend. what() is one line:
/// "path:line:column: found; expected ...; hint" (the parts that are empty are left out).
///
/// Example:
///
///     throw InputError({"drive.csv", 12, 7}, "'abc' in column 'yaw_rate'", "a number");
class InputError : public std::runtime_error {
 public:
  /// @param at        where; an empty path is left out of the message
  /// @param found     what was found, e.g. "'abc' in column 'yaw_rate'"
  /// @param expected  what would have been right, e.g. "a number"
  /// @param hint      what to do, e.g. "did you mean 'yaw_rate'?"
  InputError(const Location& at, const std::string& found, const std::string& expected = "",
             const std::string& hint = "");
};

/// A result that could not be written (exit code 5).
class OutputError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace identikal
