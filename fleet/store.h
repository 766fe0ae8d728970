// What does a fleet remember? Its jobs, and a row of results for each, in a SQLite database that is whole whenever
// the program, or the power, ends.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "fleet/manifest.h"
#include "fleet/row.h"

namespace identikal {

/// What is done with every recording of a fleet.
struct FleetTask {
  std::string verb;                  ///< "tune", "fit", "check", "validate"
  std::string model;                 ///< path of the model file, or of a result for validate
  std::vector<std::string> options;  ///< words of a command line: "--starts", "1", ...
  std::string by;                    ///< a column whose values part every recording; empty: none
  std::string folder;                ///< from which relative paths are
  std::string digest;                ///< SHA-256 of all that a result depends on but the recording

  bool operator==(const FleetTask&) const = default;
};

/// A job as the store knows it.
struct StoredJob {
  std::int64_t number = 0;  ///< its place in the manifest, from 0
  FleetJob job;
  std::string task;    ///< digest of the task that it was done with; empty: not done yet
  std::string stamp;   ///< size and time of the recording's files then
  std::string sha256;  ///< of those files
  bool again = false;  ///< it failed by something that may have passed: to be done again
};

/// A job that was done.
struct FleetResult {
  std::int64_t number = 0;
  std::string task, stamp, sha256, host, finished;  ///< finished: UTC, "2026-03-01T12:00:00Z"
  bool again = false;
  bool unchanged =
      false;  ///< the rows that are there hold: another time of the files, the same bytes
  int attempts = 1;
  double seconds = 0.0;
  std::vector<FleetRow> rows;  ///< one, or one for each part
};

/// A row with the job that it is of.
struct StoredRow {
  std::int64_t number = 0;
  FleetJob job;
  FleetRow row;
};

struct FleetCounts {
  std::int64_t jobs = 0, done = 0, rows = 0;
  std::map<std::string, std::int64_t> by_status;  ///< rows
};

/// The store, open. One process at a time may write: it holds PATH.lock.
///
/// Example:
///
///     FleetStore store("fleet.store", FleetStore::Open::read);
///     std::printf("%ld jobs\n", long(store.counts().jobs));
class FleetStore {
 public:
  enum class Open { read, write, create };

  /// @throws InputError for a file that is no store, or of a later version, or that another
  ///   process writes to; OutputError where it cannot be written
  FleetStore(const std::string& path, Open how);
  ~FleetStore();

  const std::string& path() const;
  FleetTask task();
  /// Takes the jobs of a manifest, of which those that are there already keep their results.
  /// @param costs  of each, in any unit, for shares of equal work
  void plan(const FleetTask& task, const std::vector<FleetJob>& jobs,
            const std::vector<double>& costs);
  /// The same jobs with another task: a model file that has changed.
  void set_task(const FleetTask& task);

  /// Jobs in order of number, from the one after `last` on.
  std::vector<StoredJob> jobs_after(std::int64_t last, int most);
  /// First and last number of share k of n, k = 1 .. n: about the same cost each; empty where there
  /// are fewer jobs.
  std::optional<std::pair<std::int64_t, std::int64_t>> share(int k, int n);

  /// Between these two, what is put is together in the store or is not.
  void begin();
  void commit();
  void put(const FleetResult& result);

  FleetCounts counts();
  /// Calls `each` for every row, in the order of the manifest.
  void for_each_row(const std::function<void(const StoredRow&)>& each);
  /// The first of those that failed, at most so many.
  std::vector<StoredRow> failed_rows(std::size_t most);

  /// Takes what another store of the same task, of some of the same jobs, has done.
  /// @return how many jobs. @throws InputError for a store of another task
  std::int64_t take_from(const std::string& path);
  /// The task, and jobs `first` to `last` with what is known of them, of another store.
  void copy_share(const std::string& path, std::int64_t first, std::int64_t last);

 private:
  struct Opened;
  std::unique_ptr<Opened> opened_;
};

}  // namespace identikal
