// Which options may a verb have? Each of them is defined once; help, manual and completions follow.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

// The parser stays behind options.cpp, command_line.cpp and manual.cpp: it takes seconds to
// compile.
namespace CLI {
class App;
}

namespace identikal {

/// A verb of the program.
/// @param help    a sentence
/// @param footer  below the options
CLI::App& add_verb(CLI::App& app, const char* name, const char* help,
                   const std::string& footer = "");

// Kinds of options. `names` is "--rows" or "-n,--rows", for a positional argument "MODEL"; the
// value that is there before is the default. Texts of help are sentences. An empty text is a
// mistake.

void add_argument(CLI::App& verb, const char* name, std::string& value, const std::string& help);
void add_optional_argument(CLI::App& verb, const char* name, std::string& value, const char* help);
/// One or more.
void add_arguments(CLI::App& verb, const char* name, std::vector<std::string>& values,
                   const char* help);
void add_flag(CLI::App& verb, const char* names, bool& value, const char* help);
/// @param shown  the default where `value` is empty
void add_text(CLI::App& verb, const char* names, std::string& value, const std::string& help,
              const char* shown = "");
void add_required_text(CLI::App& verb, const char* names, std::string& value,
                       const std::string& help);
/// A path that may not be empty.
void add_folder(CLI::App& verb, const char* names, std::string& value, const char* help);
/// A path that names a file.
void add_file(CLI::App& verb, const char* names, std::string& value, const char* help);
/// May be given several times, one value each.
void add_repeated(CLI::App& verb, const char* names, std::vector<std::string>& values,
                  const char* help);
/// @param shown  the default where `value` is empty
void add_choice(CLI::App& verb, const char* names, std::string& value,
                const std::vector<std::string>& values, const std::string& help,
                const char* shown = "");
/// A whole number from `least` to `most`.
/// @param shown  the default where another number, outside the range, stands for it
void add_number(CLI::App& verb, const char* names, long& value, long least, long most,
                const char* help, const char* shown = "");
void add_seed(CLI::App& verb, std::int64_t& seed, const char* help);

// Names of earlier versions: not shown, still understood, and a line on standard error says the
// name of today.

void say_renamed(const std::string& old_name, const std::string& name);
void add_old_flag(CLI::App& verb, const char* old_name, const char* name, bool& value);
void add_old_number(CLI::App& verb, const char* old_name, const char* name, long& value, long least,
                    long most);
/// @param values  the old name of each value, and its name of today
void add_old_choice(CLI::App& verb, const char* old_name, const char* name, std::string& value,
                    const std::vector<std::pair<std::string, std::string>>& values);

// Groups that verbs share.

/// Which model, with which of its values changed?
struct ModelOptions {
  std::string file;
  std::vector<std::string> settings;  ///< NAME=VALUE
  std::string filter;                 ///< of a nonlinear model; empty: the file's
  std::string from;                   ///< a result whose values are taken
};
void add_model(CLI::App& verb, ModelOptions& model, const char* help = "Model file (YAML).");
void add_settings(CLI::App& verb, ModelOptions& model);
void add_filter_choice(CLI::App& verb, ModelOptions& model);

/// Which recordings, and which rows of them?
struct RecordingOptions {
  std::vector<std::string> files;
  std::string range;  ///< FROM:TO
};
void add_recordings(CLI::App& verb, RecordingOptions& recordings);
/// At most one, of inputs alone.
void add_input_recording(CLI::App& verb, std::string& file);
void add_range(CLI::App& verb, std::string& range);

/// What becomes of a result?
struct ResultOptions {
  std::string folder;     ///< -o; empty: no files
  std::string page;       ///< --report; empty: no page
  bool has_page = false;  ///< results of this verb are drawn
  bool json = false, strict = false, quiet = false;
};
void add_output(CLI::App& verb, std::string& folder);
void add_json(CLI::App& verb, bool& json);
void add_quiet(CLI::App& verb, bool& quiet);
/// -o, --json and --strict.
void add_result(CLI::App& verb, ResultOptions& result);
/// The same with --report and --quiet: verbs whose results are drawn.
void add_result_with_page(CLI::App& verb, ResultOptions& result);

/// How is the optimum searched for, and what is it validated on?
struct SearchOptions {
  std::int64_t seed = 1;
  long starts = 0;  ///< 0: not given
  std::string hold_out;

  long number_of_starts() const { return starts > 0 ? starts : 5; }
};
void add_search(CLI::App& verb, SearchOptions& search);

/// --input, once per input.
void add_signals(CLI::App& verb, std::vector<std::string>& signals);

}  // namespace identikal
