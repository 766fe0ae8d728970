// What do the findings come to?
#pragma once

#include <string>

#include "identify/estimate/finding.h"
#include "identify/estimate/status.h"

namespace identikal {

/// What the answer of a job rests on.
enum class Basis {
  fit,    ///< values fitted to the data: a serious finding makes them untrusted
  tests,  ///< tests of given values, or values followed along the data: serious findings are
          ///< printed and leave the status as it is, unless concludes() holds for them
};

struct Conclusion {
  Status status = Status::ok;
  std::string message;
  Findings findings;  ///< all of them, in the order in which people read them
};

/// The one place where findings become a status. By finding_kinds() (identify/estimate/finding.h):
///
/// - A finding has the effect of its kind where it is serious. Of those that have one, the first
///   Rank decides; of that rank the first finding gives the status.
/// - The message is what the kind says of it (InMessage): the texts of those of the rank, the names
///   of all serious findings, or `message_when_ok` with an addition. Without any effect the status
///   is ok and the message `message_when_ok`.
/// - Where a misread channel decides, it goes first, and what it causes too becomes one note behind
///   it: those are no findings of their own. Otherwise the order stays that of the checks.
///
/// Example:
///
///     const Finding late = make_finding(FindingCode::clock_offset, {"r"}, "r comes 0.2 s late");
///     const Conclusion answer = conclude({late}, "converged");
///     std::puts((to_string(answer.status) + ": " + answer.message).c_str());
Conclusion conclude(const Findings& findings, const std::string& message_when_ok,
                    Basis basis = Basis::fit);

}  // namespace identikal
