// Recordings that a fleet makes itself: simulations of its model, one for each seed.
#pragma once

#include <string>
#include <vector>

#include "fleet/store.h"
#include "jobs/inputs.h"

namespace identikal {

/// "simulate:17 -n 300": the recording that 'simulate' makes with this seed and these words; of
/// "simulate:1-500 -n 300" there are 500.
bool is_simulation(const std::string& recording);

/// One for each seed. @throws InputError for seeds that are none, or more than ten million
std::vector<FleetJob> simulations_of(const std::string& recipe);

/// The recording. @param model  path; @param inputs  may hold its text
/// @throws InputError as 'simulate'
Table simulated_table(const std::string& recording, const std::string& model, Inputs inputs);

/// How many of the simulated recordings have an interval that holds the value they were made with?
struct Coverage {
  std::string name, unit;
  double truth = kNone;
  std::int64_t rows = 0;            ///< with status ok and an interval
  double mean = kNone, sd = kNone;  ///< of the estimates
  double mean_se = kNone;           ///< of what they say of their own errors, root mean square
  std::int64_t inside = 0;          ///< intervals that hold the truth
};

struct CoverageReport {
  std::int64_t rows = 0, ok = 0;
  std::vector<Coverage> parameters;
};

/// Example:
///
///     FleetStore store("runs.store", FleetStore::Open::read);
///     std::fputs(coverage_text(coverage_of(store)).c_str(), stdout);
///
/// @throws InputError where the recordings are not simulated, or with values that differ
CoverageReport coverage_of(FleetStore& store);
std::string coverage_text(const CoverageReport& report);
std::string coverage_json(const CoverageReport& report);

}  // namespace identikal
