// What is kept of a recording's result in a fleet's store?
#pragma once

#include <string>
#include <vector>

#include "jobs/verb.h"

#include "identify/estimate/none.h"

namespace identikal {

/// A row of a fleet's table: the result of a verb on one recording, or one part of it, or why there is none.
struct FleetRow {
  std::string part;     ///< value of the column that --by names; empty: all of the recording
  int exit_code = 5;    ///< of the verb alone, as the command line has it
  std::string status;   ///< "ok", "untrusted", ...; "failed" where there is no result
  std::string message;  ///< why
  long rows = 0;        ///< of the recording that were used
  double log_likelihood = kNone;
  // As JSON, for SQLite's functions of it:
  std::string
      parameters;  ///< {"q": {"value", "se", "low", "high", "unit", "positive", "verdict"}, ...}
  std::string
      correlation;       ///< {"names": [...], "rows": [[...], ...]} of the estimates; empty: none
  std::string fits;      ///< {"y": {"one_step", "simulation", "rmse"}, ...} [%], in y's unit
  std::string tests;     ///< {"nis": {"value", "p", "pass"}, "ljung_box y": ...}
  std::string findings;  ///< [{"code", "severity", "text"}, ...], of notes the code alone
};

/// @param out  of a verb that has an estimate
FleetRow row_of(const Outcome& out);

/// Of a recording whose job could not be done. @param exit_code  2 for its own mistake, else 5
FleetRow failed_row(int exit_code, const std::string& message);

struct RowParameter {
  std::string name, unit, verdict;
  double value = kNone, se = kNone, low = kNone, high = kNone;
  bool positive = false;  ///< by its bounds
};
/// FleetRow::parameters as values. @throws InputError for a text that holds something else
std::vector<RowParameter> parameters_of(const std::string& json);

struct RowTest {
  std::string name;
  double value = kNone, p = kNone;
  bool pass = true;
};
std::vector<RowTest> tests_of(const std::string& json);

struct RowFit {
  std::string channel;
  double one_step = kNone, simulation = kNone, rmse = kNone;
};
std::vector<RowFit> fits_of(const std::string& json);

struct RowFinding {
  std::string code, severity, text;
};
std::vector<RowFinding> findings_of(const std::string& json);

}  // namespace identikal
