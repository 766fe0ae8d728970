// Which recordings does a fleet have, and what is said of each?
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace identikal {

/// One recording of a fleet, and how its job differs from the others.
struct FleetJob {
  std::string recording;  ///< a path, or several joined by '+'
  std::string unit;       ///< whose recording it is: a vehicle, a sensor; empty: not said
  std::string group;      ///< of units; empty: not said
  std::string options;    ///< of the verb, as on a command line: "--starts 1 --set q=3"
  std::string where;      ///< which rows: "series = 17 and speed > 5"; empty: all
  /// What else the manifest says: "mileage", "12000"
  std::vector<std::pair<std::string, std::string>> covariates = {};

  bool operator==(const FleetJob&) const = default;
};

/// The jobs that manifests name, in their order. Each of them is
/// - a CSV file with a column "recording", where they are needed "unit", "group", "options" and
///   "where", and others as covariates; a path that is relative is so to the manifest's folder,
/// - a folder: its files *.csv and those of its folders, by name,
/// - a pattern, as a shell knows it: "drives/car_*/*.csv",
/// - simulations of the model: "simulate:1-500 -n 300" (fleet/simulated.h), or
/// - a recording.
///
/// Example:
///
///     for (const FleetJob& job : read_manifests({"drives/*.csv"})) {
///       std::puts(job.recording.c_str());
///     }
///
/// @throws InputError for a manifest that is not there, names no recording, has a column
///   whose name is nearly one of these, or says twice the same
std::vector<FleetJob> read_manifests(const std::vector<std::string>& manifests);

/// "--starts 1 --set 'q=3 m'" as its words; quotes are those of a shell.
/// @throws InputError for a quote that is not closed
std::vector<std::string> option_words(const std::string& options);

}  // namespace identikal
