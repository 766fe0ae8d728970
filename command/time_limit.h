// What becomes of a job that takes too long, and does not ask whether to stop?
#pragma once

namespace identikal {

/// After this many seconds the program ends: one line, exit code 5, unfinished files taken away.
void end_after(long seconds);

}  // namespace identikal
