// Has somebody asked to stop?
#pragma once

namespace identikal {

/// From here on SIGINT and SIGTERM end a search with the best so far; a second one ends the program
/// at once. A signal that is ignored already stays so.
void stop_at_signals();

/// From here on they end the program at once again, as one does that has come already.
void end_at_signals();

/// The signal that has come, or 0.
int signal_received();

}  // namespace identikal
