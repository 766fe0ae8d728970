// What does a process do that works for a fleet? It takes jobs until there are no more. For fleet alone.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "fleet/store.h"

namespace identikal {

/// How a worker is connected with the process that hands out jobs.
struct Connection {
  /// The next frame, waited for; nothing when no more will come.
  std::function<std::optional<std::string>()> receive;
  /// Sends whole frames.
  std::function<void(const std::string& frames)> send;
};

/// Works until no more jobs come.
/// @param timeout  of one row [s]; 0: none. The process is ended by SIGALRM when it is over
void work_for_fleet(const FleetTask& task, double timeout, const Connection& connection);

}  // namespace identikal
