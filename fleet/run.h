// How are all recordings of a fleet done, though processes die and files are bad?
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "fleet/store.h"

namespace identikal {

struct Workers;  // fleet/internal/workers.h

struct FleetRun {
  int workers = 0;       ///< processes; 0: one for each processor
  int retries = 3;       ///< of a recording whose process died
  double timeout = 0.0;  ///< of a row [s]; 0: none
  /// Told from time to time how far it is. @return false to stop
  std::function<bool(const std::string& what, double share)> progress;
};

struct SlowJob {
  std::string recording;
  double seconds = 0.0;
};

struct FleetSummary {
  std::int64_t jobs = 0;       ///< of the store
  std::int64_t done_now = 0;   ///< by this run
  std::int64_t unchanged = 0;  ///< that had been done before
  int died = 0;                ///< processes, of which the work was done again
  bool stopped = false;        ///< before all were done
  double seconds = 0.0;
  int workers = 0;
  double working = 0.0;          ///< time that jobs took, of all workers [s]
  std::vector<SlowJob> slowest;  ///< that took ten times as long as usual, and more than 1 s
};

/// Does every job of the store that is not done, and puts the results there as they come: what was
/// committed stays, whatever ends the program. A recording that cannot be done is a row that says
/// why.
///
/// Example:
///
///     FleetStore store("fleet.store", FleetStore::Open::write);
///     const FleetSummary summary = run_fleet(store, {.workers = 2});
///     std::printf("%ld recordings\n", long(summary.done_now));
///
/// @throws InputError for a model that cannot be read, OutputError where the store takes no more
FleetSummary run_fleet(FleetStore& store, const FleetRun& run);
/// The same with workers that are there.
FleetSummary run_fleet(FleetStore& store, const FleetRun& run, const Workers& workers);

/// The same by processes that mpirun has started: this is rank 0, which works too.
FleetSummary run_fleet_by_mpi(FleetStore& store, const FleetRun& run);
/// Of every other rank: works for rank 0 until there is no more to do.
void work_as_rank(const FleetTask& task, const FleetRun& run);

}  // namespace identikal
