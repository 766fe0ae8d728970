#include "jobs/options.h"

#include <algorithm>
#include <charconv>

#include "jobs/verb.h"
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "lib/base/error.h"
#include "lib/base/nearest_name.h"

namespace identikal {
namespace {

using Check = std::function<void(std::string&)>;

// "--rows" of "-n,--rows", "MODEL" of "MODEL": how messages call an option.
std::string called(const std::string& names) { return names.substr(names.rfind(',') + 1); }

// Else an empty value would be taken for one that is not given.
Check not_empty(const std::string& names, const std::string& expected) {
  return [name = called(names), expected](const std::string& text) {
    if (text.empty()) throw InputError({}, name + " is empty", expected);
  };
}

Check names_a_file(const std::string& names) {
  return [name = called(names)](const std::string& text) {
    if (text.empty()) throw InputError({}, name + " is empty", "a file");
    if (text.ends_with('/')) {
      throw InputError({}, fmt::format("{} '{}' names no file", name, text), "a file");
    }
  };
}

// Writes the number as a decimal one: a parser might take 010 for 8.
Check whole_number(const std::string& names, std::int64_t least, std::int64_t most) {
  return [name = called(names), least, most](std::string& text) {
    std::int64_t value = 0;
    const char* const end = text.data() + text.size();
    const auto [stopped, error] = std::from_chars(text.data(), end, value);
    if (text.empty() || error != std::errc() || stopped != end || value < least || value > most) {
      throw InputError({}, fmt::format("{} '{}'", name, text),
                       fmt::format("a whole number from {} to {}", least, most));
    }
    text = std::to_string(value);
  };
}

Check one_of(const std::string& names, const std::vector<std::string>& values) {
  return [name = called(names), values](const std::string& text) {
    if (std::find(values.begin(), values.end(), text) != values.end()) return;
    throw InputError({}, fmt::format("{} '{}'", name, text),
                     fmt::format("one of {}", fmt::join(values, ", ")), did_you_mean(text, values));
  };
}

std::string in_range(std::int64_t least, std::int64_t most) {
  return fmt::format("INT in [{} - {}]", least, most);
}

// The option just added, for what few options have beside a name, a help and a value.
template <typename Value>
Option& add(Verb& verb, const std::string& names, Value& value, const std::string& help,
            Check check) {
  Option option;
  option.names = names;
  option.help = help;
  option.value = &value;
  option.check = std::move(check);
  verb.options.push_back(std::move(option));
  return verb.options.back();
}

}  // namespace

void take(const Option& option, std::string text) {
  if (option.check) option.check(text);
  if (bool* const* flag = std::get_if<bool*>(&option.value)) {
    **flag = true;
  } else if (std::int64_t* const* number = std::get_if<std::int64_t*>(&option.value)) {
    std::from_chars(text.data(), text.data() + text.size(), **number);
  } else if (std::string* const* one = std::get_if<std::string*>(&option.value)) {
    **one = std::move(text);
  } else {
    std::get<std::vector<std::string>*>(option.value)->push_back(std::move(text));
  }
}

void add_argument(Verb& verb, const char* name, std::string& value, const std::string& help) {
  add(verb, name, value, help, not_empty(name, "a value")).required = true;
}

void add_optional_argument(Verb& verb, const char* name, std::string& value, const char* help) {
  add(verb, name, value, help, not_empty(name, "a value"));
}

void add_arguments(Verb& verb, const char* name, std::vector<std::string>& values,
                   const char* help) {
  add(verb, name, values, help, not_empty(name, "a file")).required = true;
}

void add_flag(Verb& verb, const char* names, bool& value, const char* help) {
  add(verb, names, value, help, {});
}

void add_text(Verb& verb, const char* names, std::string& value, const std::string& help,
              const char* shown) {
  add(verb, names, value, help, not_empty(names, "a value")).shown = value.empty() ? shown : value;
}

void add_required_text(Verb& verb, const char* names, std::string& value, const std::string& help) {
  add(verb, names, value, help, not_empty(names, "a value")).required = true;
}

void add_folder(Verb& verb, const char* names, std::string& value, const char* help) {
  add(verb, names, value, help, not_empty(names, "a folder"));
}

void add_file(Verb& verb, const char* names, std::string& value, const char* help) {
  add(verb, names, value, help, names_a_file(names));
}

void add_repeated(Verb& verb, const char* names, std::vector<std::string>& values,
                  const char* help) {
  add(verb, names, values, help, not_empty(names, "a value"));
}

void add_choice(Verb& verb, const char* names, std::string& value,
                const std::vector<std::string>& values, const std::string& help,
                const char* shown) {
  Option& option = add(verb, names, value, help, one_of(names, values));
  option.shown = value.empty() ? shown : value;
  option.limits = fmt::format("{{{}}}", fmt::join(values, ","));
}

void add_number(Verb& verb, const char* names, std::int64_t& value, std::int64_t least,
                std::int64_t most, const char* help, const char* shown) {
  Option& option = add(verb, names, value, help, whole_number(names, least, most));
  option.shown = value >= least && value <= most ? std::to_string(value) : shown;
  option.limits = in_range(least, most);
}

void add_seed(Verb& verb, std::int64_t& seed, const char* help, const char* shown) {
  add(verb, "--seed", seed, help, whole_number("--seed", 0, 999999999999999999)).shown =
      seed >= 0 ? std::to_string(seed) : shown;
}

void add_old_flag(Verb& verb, const char* old_name, const char* name, bool& value) {
  add(verb, old_name, value, "", {}).now = name;
}

void add_old_number(Verb& verb, const char* old_name, const char* name, std::int64_t& value,
                    std::int64_t least, std::int64_t most) {
  add(verb, old_name, value, "", whole_number(old_name, least, most)).now = name;
}

void add_old_choice(Verb& verb, const char* old_name, const char* name, std::string& value,
                    const std::vector<std::pair<std::string, std::string>>& values) {
  std::vector<std::string> known;
  known.reserve(values.size());
  for (const auto& [old_value, new_value] : values) known.push_back(old_value);
  const auto translate = [check = one_of(old_name, known), values](std::string& given) {
    check(given);
    given = std::find_if(values.begin(), values.end(), [&](const auto& each) {
              return each.first == given;
            })->second;
  };
  add(verb, old_name, value, "", translate).now = name;
}

void add_model(Verb& verb, ModelOptions& model, const char* help) {
  add_argument(verb, "MODEL", model.file, help);
}

void add_settings(Verb& verb, ModelOptions& model) {
  add_repeated(verb, "--set", model.settings,
               "Set a parameter (or its start): NAME=VALUE. May be repeated.");
}

void add_filter_choice(Verb& verb, ModelOptions& model) {
  add_choice(verb, "--filter", model.filter, {"extended", "iterated", "unscented"},
             "Choose the Kalman filter of a nonlinear model.", "extended");
}

void add_recordings(Verb& verb, RecordingOptions& recordings) {
  add_arguments(verb, "DATA", recordings.files, "Recordings (CSV).");
}

void add_input_recording(Verb& verb, std::string& file) {
  add_optional_argument(verb, "DATA", file, "Recording that holds the inputs.");
}

void add_range(Verb& verb, std::string& range) {
  add_text(verb, "--range", range,
           "Use the rows FROM:TO, in seconds from the first row, e.g. 10s:95s.");
}

void add_output(Verb& verb, std::string& folder) {
  add_folder(verb, "-o,--output", folder, "Write the result files to this folder.");
}

void add_json(Verb& verb, bool& json) {
  add_flag(verb, "--json", json, "Print the result as JSON instead of text.");
}

void add_quiet(Verb& verb, bool& quiet) {
  add_flag(verb, "--quiet", quiet, "Show no progress line.");
}

void add_result(Verb& verb, ResultOptions& result) {
  add_output(verb, result.folder);
  add_json(verb, result.json);
  add_strict(verb, result.strict);
}

void add_strict(Verb& verb, bool& strict) {
  add_flag(verb, "--strict", strict, "End with exit status 4 when there are warnings.");
}

void add_result_with_page(Verb& verb, ResultOptions& result) {
  add_result(verb, result);
  add_page(verb, result);
}

void add_page(Verb& verb, ResultOptions& result) {
  add_file(verb, "--report", result.page, "Write everything as one HTML page to this file.");
  add_quiet(verb, result.quiet);
  result.has_page = true;
}

void add_time_limit(Verb& verb, std::int64_t& seconds) {
  add_number(verb, "--time-limit", seconds, 1, 1000000,
             "Stop with the best so far after this many seconds.", "none");
}

void add_search(Verb& verb, SearchOptions& search) {
  add_seed(verb, search.seed, "Seed of the random starts.", "1");
  add_number(verb, "--starts", search.starts, 1, 1000,
             "Number of starts of the search. Without it 5; by likelihood 1, and 5 where the first "
             "leaves a doubt.");
  add_number(verb, "--iterations", search.iterations, 1, 1000000, "Most iterations of each search.",
             "200");
  add_number(verb, "--threads", search.threads, 1, 1024,
             "Number of threads that share starts and profiles of a likelihood; the result does "
             "not depend on it. Without it, one for each core.");
  add_text(verb, "--hold-out", search.hold_out,
           "Hold out data for validation: a recording, or the last share of each, e.g. 30%.");
}

void add_signals(Verb& verb, std::vector<std::string>& signals) {
  add_repeated(verb, "--input", signals,
               "Drive an input by a formula of the time t in s, in SI units, e.g. "
               "'u=sin(2*pi*t/5)'. Once per input.");
}

}  // namespace identikal
