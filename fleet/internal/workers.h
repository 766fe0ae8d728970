// Who works for a fleet: processes of this machine, or of others. For fleet alone.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "fleet/internal/worker.h"

namespace identikal {

/// What came from a worker: bytes, and whether it has ended.
struct WorkerEvent {
  int worker = 0;
  std::string bytes;
  bool ended = false;
  int signal = 0;               ///< that ended it; 0: none
  bool without_memory = false;  ///< it has ended because a request for memory failed
};

/// Workers as the coordinator sees them. What they hold lives as long as this.
struct Workers {
  int count = 0;
  std::function<void(int worker, const std::string& frame)> send;  ///< returns at once
  /// Waits for events, at most so long [s].
  std::function<std::vector<WorkerEvent>(double seconds)> wait;
  std::function<void(int worker)> restart;  ///< one that has ended
};

/// Processes of this machine, forked from this one: before it has threads. They end with it,
/// whatever ends it.
/// @throws OutputError where the system gives none
Workers local_workers(int count, std::function<void(const Connection& connection)> work);

/// How many processors this process may use.
int usable_processors();

}  // namespace identikal
