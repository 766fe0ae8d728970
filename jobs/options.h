// Which options may a verb have? Each of them is described once; the command line with its help, manual and
// completions follows, and so do the options of a program.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

namespace identikal {

struct Verb;

/// An option, or an argument that has no dashes: what it may be, and where its value goes.
struct Option {
  std::string names;  ///< "--rows" or "-n,--rows"; of an argument "MODEL"
  std::string help;   ///< a sentence
  std::variant<bool*, std::int64_t*, std::string*, std::vector<std::string>*> value;
  bool required = false;
  std::string shown;   ///< the default, as help shows it
  std::string limits;  ///< what else help says of values: "INT in [1 - 1000]", "{ml,als}"
  /// Writes a value as it is read. @throws InputError for a text that is none
  std::function<void(std::string& text)> check;
  std::string now;  ///< of a name of earlier versions, which help does not show: today's

  bool is_flag() const { return std::holds_alternative<bool*>(value); }
  bool is_list() const { return std::holds_alternative<std::vector<std::string>*>(value); }
  bool is_argument() const { return !names.starts_with('-'); }
  /// How messages call it: "--rows", "MODEL".
  std::string called() const { return names.substr(names.rfind(',') + 1); }
};

/// Takes a value; of a list one more, of a flag any.
/// @throws InputError for a text that is no value of the option
void take(const Option& option, std::string text);

// Kinds of options, added to a verb. `names` as above; the value that is there before is the
// default. Texts of help are sentences. An empty text is a mistake.

void add_argument(Verb& verb, const char* name, std::string& value, const std::string& help);
void add_optional_argument(Verb& verb, const char* name, std::string& value, const char* help);
/// One or more.
void add_arguments(Verb& verb, const char* name, std::vector<std::string>& values,
                   const char* help);
void add_flag(Verb& verb, const char* names, bool& value, const char* help);
/// @param shown  the default where `value` is empty
void add_text(Verb& verb, const char* names, std::string& value, const std::string& help,
              const char* shown = "");
void add_required_text(Verb& verb, const char* names, std::string& value, const std::string& help);
/// A path that may not be empty.
void add_folder(Verb& verb, const char* names, std::string& value, const char* help);
/// A path that names a file.
void add_file(Verb& verb, const char* names, std::string& value, const char* help);
/// May be given several times, one value each.
void add_repeated(Verb& verb, const char* names, std::vector<std::string>& values,
                  const char* help);
/// @param shown  the default where `value` is empty
void add_choice(Verb& verb, const char* names, std::string& value,
                const std::vector<std::string>& values, const std::string& help,
                const char* shown = "");
/// A whole number from `least` to `most`.
/// @param shown  the default where another number, outside the range, stands for it
void add_number(Verb& verb, const char* names, std::int64_t& value, std::int64_t least,
                std::int64_t most, const char* help, const char* shown = "");
/// @param shown  the default where a negative `seed` stands for it
void add_seed(Verb& verb, std::int64_t& seed, const char* help, const char* shown = "");

// Names of earlier versions: still understood on the command line, which says today's name.

void add_old_flag(Verb& verb, const char* old_name, const char* name, bool& value);
void add_old_number(Verb& verb, const char* old_name, const char* name, std::int64_t& value,
                    std::int64_t least, std::int64_t most);
/// @param values  the old name of each value, and its name of today
void add_old_choice(Verb& verb, const char* old_name, const char* name, std::string& value,
                    const std::vector<std::pair<std::string, std::string>>& values);

// Groups that verbs share.

/// Which model, with which of its values changed?
struct ModelOptions {
  std::string file;
  std::vector<std::string> settings;  ///< NAME=VALUE
  std::string filter;                 ///< of a nonlinear model; empty: the file's
  std::string from;                   ///< a result whose values are taken
};
void add_model(Verb& verb, ModelOptions& model, const char* help = "Model file (YAML).");
void add_settings(Verb& verb, ModelOptions& model);
void add_filter_choice(Verb& verb, ModelOptions& model);

/// Which recordings, and which rows of them?
struct RecordingOptions {
  std::vector<std::string> files;
  std::string range;  ///< FROM:TO
};
void add_recordings(Verb& verb, RecordingOptions& recordings);
/// At most one, of inputs alone.
void add_input_recording(Verb& verb, std::string& file);
void add_range(Verb& verb, std::string& range);

/// What becomes of a result?
struct ResultOptions {
  std::string folder;     ///< -o; empty: no files
  std::string page;       ///< --report; empty: no page
  bool has_page = false;  ///< results of this verb are drawn
  bool json = false, strict = false, quiet = false;
};
void add_output(Verb& verb, std::string& folder);
void add_json(Verb& verb, bool& json);
void add_quiet(Verb& verb, bool& quiet);
void add_strict(Verb& verb, bool& strict);
/// --report and --quiet.
void add_page(Verb& verb, ResultOptions& result);
/// -o, --json and --strict.
void add_result(Verb& verb, ResultOptions& result);
/// The same with --report and --quiet: verbs whose results are drawn.
void add_result_with_page(Verb& verb, ResultOptions& result);

/// How is the optimum searched for, and what is it validated on?
struct SearchOptions {
  std::int64_t seed = -1;       ///< -1: not given
  std::int64_t starts = 0;      ///< 0: not given
  std::int64_t iterations = 0;  ///< 0: not given
  std::int64_t threads = 0;     ///< 0: one for each core; of a filter's likelihood
  std::string hold_out;

  std::uint64_t seed_number() const { return seed >= 0 ? static_cast<std::uint64_t>(seed) : 1; }
  int number_of_starts() const { return starts > 0 ? static_cast<int>(starts) : 5; }
};
void add_search(Verb& verb, SearchOptions& search);

/// --time-limit: see limit_time().
void add_time_limit(Verb& verb, std::int64_t& seconds);

/// --input, once per input.
void add_signals(Verb& verb, std::vector<std::string>& signals);

}  // namespace identikal
