#include "command/options.h"

#include <iostream>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

namespace identikal {
namespace {

std::string whole_number(const std::string& text) {
  const bool digits = !text.empty() && text.size() <= 18 &&
                      text.find_first_not_of("0123456789") == std::string::npos;
  return digits ? "" : "'" + text + "' is not a whole number from 0 to 999999999999999999";
}

std::string a_file(const std::string& text) {
  return text.empty() || text.ends_with('/') ? "no file is named" : std::string();
}

std::string a_folder(const std::string& text) {
  return text.empty() ? "no folder is named" : std::string();
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
  verb.add_option(name, value, help)->required();
}

void add_optional_argument(CLI::App& verb, const char* name, std::string& value, const char* help) {
  verb.add_option(name, value, help);
}

void add_arguments(CLI::App& verb, const char* name, std::vector<std::string>& values,
                   const char* help) {
  verb.add_option(name, values, help)->required();
}

void add_flag(CLI::App& verb, const char* names, bool& value, const char* help) {
  verb.add_flag(names, value, help);
}

void add_text(CLI::App& verb, const char* names, std::string& value, const std::string& help) {
  verb.add_option(names, value, help)->capture_default_str();
}

void add_required_text(CLI::App& verb, const char* names, std::string& value,
                       const std::string& help) {
  verb.add_option(names, value, help)->required();
}

void add_folder(CLI::App& verb, const char* names, std::string& value, const char* help) {
  verb.add_option(names, value, help)->check(a_folder);
}

void add_file(CLI::App& verb, const char* names, std::string& value, const char* help) {
  verb.add_option(names, value, help)->check(a_file);
}

void add_repeated(CLI::App& verb, const char* names, std::vector<std::string>& values,
                  const char* help) {
  verb.add_option(names, values, help)->allow_extra_args(false);
}

void add_choice(CLI::App& verb, const char* names, std::string& value,
                const std::vector<std::string>& values, const std::string& help,
                const char* shown) {
  verb.add_option(names, value, help)
      ->check(CLI::IsMember(values))
      ->default_str(value.empty() ? shown : value);
}

void add_number(CLI::App& verb, const char* names, long& value, long least, long most,
                const char* help, const char* shown) {
  CLI::Option* option = verb.add_option(names, value, help)->check(CLI::Range(least, most));
  if (value >= least && value <= most) {
    option->capture_default_str();
  } else {
    option->default_str(shown);
  }
}

void add_seed(CLI::App& verb, std::int64_t& seed, const char* help) {
  verb.add_option("--seed", seed, help)->check(whole_number)->capture_default_str();
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
  hide(verb.add_option_function<long>(old_name, take)->check(CLI::Range(least, most)));
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
  add_number(verb, "--starts", search.starts, 1, 1000, "Number of starts of the search.");
  add_text(verb, "--hold-out", search.hold_out,
           "Hold out data for validation: a recording, or the last share of each, e.g. 30%.");
}

void add_signals(CLI::App& verb, std::vector<std::string>& signals) {
  add_repeated(verb, "--input", signals,
               "Drive an input by a formula of the time t in s, in SI units, e.g. "
               "'u=sin(2*pi*t/5)'. Once per input.");
}

}  // namespace identikal
