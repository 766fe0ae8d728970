// What may a person do with a result?
#pragma once

#include <string>

namespace identikal {

/// The codes of the JSON result.
enum class Status {
  ok,
  rejected,  ///< a test rejects, or the data do not determine the unknowns
  not_converged,
  untrusted,
};

/// As results print it: "not_converged".
///
/// Example:
///
///     std::puts(to_string(Status::not_converged).c_str());  // not_converged
std::string to_string(Status status);

}  // namespace identikal
