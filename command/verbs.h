// Which verbs are there? Each has its file, with its options and what it does.
#pragma once

#include <functional>
#include <string>

#include "command/options.h"

namespace identikal {

struct Verb {
  std::string name;
  /// What it does with the options that were parsed: prints, writes, and gives the exit code.
  /// @param command  the command line as typed
  std::function<int(const std::string& command)> run;
};

/// Each adds the verb to the command line.
Verb info_verb(CLI::App& app);
Verb init_verb(CLI::App& app);
Verb tune_verb(CLI::App& app);
Verb fit_verb(CLI::App& app);
Verb check_verb(CLI::App& app);
Verb track_verb(CLI::App& app);
Verb filter_verb(CLI::App& app);
Verb compare_verb(CLI::App& app);
Verb shape_verb(CLI::App& app);
Verb bound_verb(CLI::App& app);
Verb report_verb(CLI::App& app);
Verb export_verb(CLI::App& app);
Verb validate_verb(CLI::App& app);
Verb study_verb(CLI::App& app);
Verb simulate_verb(CLI::App& app);

}  // namespace identikal
