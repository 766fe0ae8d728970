#include "command/options.h"

#include <algorithm>
#include <charconv>
#include <iostream>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "lib/base/error.h"
#include "lib/base/nearest_name.h"

namespace identikal {
namespace {

// "--rows" of "-n,--rows", "MODEL" of "MODEL": how messages call an option.
std::string called(const std::string& names) { return names.substr(names.rfind(',') + 1); }

// Checks throw an InputError of their own, as the parser's messages say neither what was expected
// nor what to do.

// Else an empty value would be taken for one that is not given.
CLI::Validator not_empty(const std::string& names, const std::string& expected) {
  return {[name = called(names), expected](const std::string& text) {
            if (text.empty()) throw InputError({}, name + " is empty", expected);
            return std::string();
          },
          ""};
}

CLI::Validator names_a_file(const std::string& names) {
  return {[name = called(names)](const std::string& text) {
            if (text.ends_with('/')) {
              throw InputError({}, fmt::format("{} '{}' names no file", name, text), "a file");
            }
            return std::string();
          },
          ""};
}

// Makes the text one that the parser reads as decimal: it would take 010 for 8.
CLI::Validator whole_number(const std::string& names, std::int64_t least, std::int64_t most,
                            const std::string& limits) {
  return {[name = called(names), least, most](std::string& text) {
            std::int64_t value = 0;
            const char* const end = text.data() + text.size();
            const auto [stopped, error] = std::from_chars(text.data(), end, value);
            if (text.empty() || error != std::errc() || stopped != end || value < least ||
                value > most) {
              throw InputError({}, fmt::format("{} '{}'", name, text),
                               fmt::format("a whole number from {} to {}", least, most));
            }
            text = std::to_string(value);
            return std::string();
          },
          limits};
}

CLI::Validator range_of(const std::string& names, long least, long most) {
  return whole_number(names, least, most, fmt::format("INT in [{} - {}]", least, most));
}

CLI::Validator one_of(const std::string& names, const std::vector<std::string>& values) {
  return {[name = called(names), values](const std::string& text) {
            if (std::find(values.begin(), values.end(), text) != values.end()) return std::string();
            throw InputError({}, fmt::format("{} '{}'", name, text),
                             fmt::format("one of {}", fmt::join(values, ", ")),
                             did_you_mean(text, values));
          },
          fmt::format("{{{}}}", fmt::join(values, ","))};
}

// Not shown by help, manual and completions.
void hide(CLI::Option* option) { option->group(""); }

}  // namespace

CLI::App& add_verb(CLI::App& app, const char* name, const char* help, const std::string& footer) {
  CLI::App* verb = app.add_subcommand(name, help);
  verb->footer(footer);
  return *verb;
}

void add_argument(CLI::App& verb, const char* name, std::string& value, const std::string& help) {
  verb.add_option(name, value, help)->required()->check(not_empty(name, "a value"));
}

void add_optional_argument(CLI::App& verb, const char* name, std::string& value, const char* help) {
  verb.add_option(name, value, help)->check(not_empty(name, "a value"));
}

void add_arguments(CLI::App& verb, const char* name, std::vector<std::string>& values,
                   const char* help) {
  verb.add_option(name, values, help)->required()->check(not_empty(name, "a file"));
}

void add_flag(CLI::App& verb, const char* names, bool& value, const char* help) {
  verb.add_flag(names, value, help)->disable_flag_override();
}

void add_text(CLI::App& verb, const char* names, std::string& value, const std::string& help,
              const char* shown) {
  verb.add_option(names, value, help)
      ->check(not_empty(names, "a value"))
      ->default_str(value.empty() ? shown : value);
}

void add_required_text(CLI::App& verb, const char* names, std::string& value,
                       const std::string& help) {
  verb.add_option(names, value, help)->required()->check(not_empty(names, "a value"));
}

void add_folder(CLI::App& verb, const char* names, std::string& value, const char* help) {
  verb.add_option(names, value, help)->check(not_empty(names, "a folder"));
}

void add_file(CLI::App& verb, const char* names, std::string& value, const char* help) {
  verb.add_option(names, value, help)
      ->check(not_empty(names, "a file"))
      ->check(names_a_file(names));
}

void add_repeated(CLI::App& verb, const char* names, std::vector<std::string>& values,
                  const char* help) {
  verb.add_option(names, values, help)->allow_extra_args(false)->check(not_empty(names, "a value"));
}

void add_choice(CLI::App& verb, const char* names, std::string& value,
                const std::vector<std::string>& values, const std::string& help,
                const char* shown) {
  verb.add_option(names, value, help)
      ->check(one_of(names, values))
      ->default_str(value.empty() ? shown : value);
}

void add_number(CLI::App& verb, const char* names, long& value, long least, long most,
                const char* help, const char* shown) {
  CLI::Option* option =
      verb.add_option(names, value, help)->transform(range_of(names, least, most));
  if (value >= least && value <= most) {
    option->capture_default_str();
  } else {
    option->default_str(shown);
  }
}

void add_seed(CLI::App& verb, std::int64_t& seed, const char* help) {
  verb.add_option("--seed", seed, help)
      ->transform(whole_number("--seed", 0, 999999999999999999, ""))
      ->capture_default_str();
}

void say_renamed(const std::string& old_name, const std::string& name) {
  std::cerr << fmt::format(
      "identikal: {} is called {} now; the next version will not know the old name\n", old_name,
      name);
}

void add_old_flag(CLI::App& verb, const char* old_name, const char* name, bool& value) {
  hide(verb.add_flag_callback(old_name, [old_name, name, &value] {
    value = true;
    say_renamed(old_name, name);
  }));
}

void add_old_number(CLI::App& verb, const char* old_name, const char* name, long& value, long least,
                    long most) {
  const auto take = [old_name, name, &value](const long& given) {
    value = given;
    say_renamed(old_name, name);
  };
  hide(verb.add_option_function<long>(old_name, take)->transform(range_of(old_name, least, most)));
}

void add_old_choice(CLI::App& verb, const char* old_name, const char* name, std::string& value,
                    const std::vector<std::pair<std::string, std::string>>& values) {
  std::vector<std::string> known;
  known.reserve(values.size());
  for (const auto& [old_value, new_value] : values) known.push_back(old_value);
  const auto take = [old_name, name, values, &value](const std::string& given) {
    const auto of_today = std::find_if(values.begin(), values.end(),
                                       [&](const auto& each) { return each.first == given; });
    value = of_today->second;
    say_renamed(fmt::format("{} {}", old_name, given), fmt::format("{} {}", name, value));
  };
  hide(verb.add_option_function<std::string>(old_name, take)->check(one_of(old_name, known)));
}

void add_model(CLI::App& verb, ModelOptions& model, const char* help) {
  add_argument(verb, "MODEL", model.file, help);
}

void add_settings(CLI::App& verb, ModelOptions& model) {
  add_repeated(verb, "--set", model.settings,
               "Set a parameter (or its start): NAME=VALUE. May be repeated.");
}

void add_filter_choice(CLI::App& verb, ModelOptions& model) {
  add_choice(verb, "--filter", model.filter, {"extended", "iterated", "unscented"},
             "Choose the Kalman filter of a nonlinear model.", "extended");
}

void add_recordings(CLI::App& verb, RecordingOptions& recordings) {
  add_arguments(verb, "DATA", recordings.files, "Recordings (CSV).");
}

void add_input_recording(CLI::App& verb, std::string& file) {
  add_optional_argument(verb, "DATA", file, "Recording that holds the inputs.");
}

void add_range(CLI::App& verb, std::string& range) {
  add_text(verb, "--range", range,
           "Use the rows FROM:TO, in seconds from the first row, e.g. 10s:95s.");
}

void add_output(CLI::App& verb, std::string& folder) {
  add_folder(verb, "-o,--output", folder, "Write the result files to this folder.");
}

void add_json(CLI::App& verb, bool& json) {
  add_flag(verb, "--json", json, "Print the result as JSON instead of text.");
}

void add_quiet(CLI::App& verb, bool& quiet) {
  add_flag(verb, "--quiet", quiet, "Show no progress line.");
}

void add_result(CLI::App& verb, ResultOptions& result) {
  add_output(verb, result.folder);
  add_json(verb, result.json);
  add_flag(verb, "--strict", result.strict, "End with exit status 4 when there are warnings.");
}

void add_result_with_page(CLI::App& verb, ResultOptions& result) {
  add_result(verb, result);
  add_file(verb, "--report", result.page, "Write everything as one HTML page to this file.");
  add_quiet(verb, result.quiet);
  result.has_page = true;
}

void add_search(CLI::App& verb, SearchOptions& search) {
  add_seed(verb, search.seed, "Seed of the random starts.");
  add_number(verb, "--starts", search.starts, 1, 1000, "Number of starts of the search.", "5");
  add_text(verb, "--hold-out", search.hold_out,
           "Hold out data for validation: a recording, or the last share of each, e.g. 30%.");
}

void add_signals(CLI::App& verb, std::vector<std::string>& signals) {
  add_repeated(verb, "--input", signals,
               "Drive an input by a formula of the time t in s, in SI units, e.g. "
               "'u=sin(2*pi*t/5)'. Once per input.");
}

}  // namespace identikal
