// Whole jobs, as the command line and as a program in C asks for them. What is asked for ends after a while: the search
// is told to stop. Files are neither written nor read but those that are given here.
#include <algorithm>
#include <charconv>
#include <chrono>
#include <cstdlib>
#include <stdexcept>
#include <string>
#include <vector>

#include "interface/identikal.h"
#include "jobs/verbs.h"

#include "command/command_line.h"
#include "lib/base/error.h"
#include "tests/fuzz/targets.h"

namespace identikal::fuzz {
namespace {

constexpr auto kEnough = std::chrono::milliseconds(300);

using Clock = std::chrono::steady_clock;

// Not one that writes or opens a file, or asks for more work than there is time for.
bool is_harmless(std::string_view word) {
  const auto is_digit = [](char c) { return c >= '0' && c <= '9'; };
  int digits = 0;
  for (const char c : word) {
    digits = is_digit(c) ? digits + 1 : 0;
    if (digits > 3 || c == '/' || c == '+') return false;
  }
  constexpr std::string_view kWrites[] = {"-o",     "--output", "--report",
                                          "--from", "--with",   "--compare"};
  return std::none_of(std::begin(kWrites), std::end(kWrites),
                      [&](std::string_view option) { return word.starts_with(option); });
}

struct NamedVerb {
  const char* name;
  Verb (*make)();
};
constexpr NamedVerb kVerbs[] = {
    {"tune", tune_verb},         {"fit", fit_verb},           {"check", check_verb},
    {"track", track_verb},       {"filter", filter_verb},     {"shape", shape_verb},
    {"bound", bound_verb},       {"validate", validate_verb}, {"simulate", simulate_verb},
    {"handling", handling_verb}, {"forecast", forecast_verb}, {"model", model_verb}};

// "--starts 2": an option and its value; a verb that has it takes it.
void take_word(const Verb& verb, const std::string& line) {
  const std::size_t space = line.find(' ');
  const std::string name = line.substr(0, space);
  const std::string value = space == std::string::npos ? "" : line.substr(space + 1);
  for (const Option& option : verb.options) {
    if (!option.is_argument() &&
        ("," + option.names + ",").find("," + name + ",") != std::string::npos) {
      take(option, value);
    }
  }
}

void run_job(const std::vector<std::string>& words, const std::string& model,
             const std::string& data) {
  const NamedVerb* named = std::find_if(std::begin(kVerbs), std::end(kVerbs), [&](const auto& v) {
    return !words.empty() && words.front() == v.name;
  });
  if (named == std::end(kVerbs)) return;
  const Verb verb = named->make();
  Call call;
  call.inputs.keep_text("model.yaml", model);
  call.inputs.keep_table("data.csv", parse_csv(data, "data.csv"));
  for (const Option& option : verb.options) {
    if (option.names == "--threads") take(option, "1");
    if (option.names == "MODEL") take(option, "model.yaml");
    if (option.names == "DATA" || option.names == "FILES") take(option, "data.csv");
  }
  for (const std::string& word : words) {
    if (word.starts_with('-') && is_harmless(word)) take_word(verb, word);
  }
  const auto begin = Clock::now();
  call.progress = [begin](const std::string&, double, double) {
    return Clock::now() - begin < kEnough;
  };
  const Outcome outcome = verb.run(call);
  if (outcome.exit_code < 0 || outcome.exit_code > 4) std::abort();
}

}  // namespace

void command_line(std::string_view bytes) {
  std::vector<std::string> words = lines_of(bytes.substr(0, bytes.find('\0')));
  words.insert(words.begin(), "identikal");
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  try {
    read_command_line(static_cast<int>(words.size()), argv.data());
  } catch (const InputError& error) {
    require_one_line(error.what());
  }
}

void job(std::string_view bytes) {
  const std::vector<std::string> given = pieces(bytes, 3);
  if (given[1].find("include") != std::string::npos) return;
  try {
    run_job(lines_of(given[0]), given[1], given[2]);
  } catch (const InputError& error) {
    require_one_line(error.what());
  } catch (const std::invalid_argument& error) {
    require_one_line(error.what());
  }
}

void interface(std::string_view bytes) {
  const std::vector<std::string> given = pieces(bytes, 3);
  if (given[1].find("include") != std::string::npos || given[0].find('/') != std::string::npos) {
    return;
  }
  const std::vector<std::string> first = lines_of(given[0]);
  const std::string verb = first.empty() ? "" : first[0].c_str();
  const std::string options = first.size() > 1 ? first[1].c_str() : "";
  if (!is_harmless(options) || options.find("output") != std::string::npos ||
      options.find("report") != std::string::npos) {
    return;
  }
  // Numbers of the last piece: rows of as many channels as its first line has.
  std::vector<double> values;
  std::size_t channels = 0;
  for (const std::string& line : lines_of(given[2])) {
    for (std::size_t at = 0; at < line.size();) {
      const std::size_t end = std::min(line.find(',', at), line.size());
      double value = 0.0;
      std::from_chars(line.data() + at, line.data() + end, value);
      values.push_back(value);
      at = end + 1;
    }
    if (channels == 0) channels = values.size();
  }
  ik_recording recording{};
  recording.rows = channels > 0 ? values.size() / channels : 0;
  recording.ny = channels > 1 ? channels - 1 : channels;
  recording.nu = channels > 1 ? 1 : 0;
  recording.y = values.data();
  recording.u = values.data() + recording.rows * recording.ny;
  recording.step = 1.0;
  auto begin = Clock::now();
  const auto more = [](void* user, const char*, double, double) -> int {
    return Clock::now() - *static_cast<Clock::time_point*>(user) < kEnough ? 1 : 0;
  };
  const ik_callbacks callbacks{sizeof(ik_callbacks), more, &begin};
  ik_result* made = nullptr;
  const int code = ik_run(verb.c_str(), given[1].c_str(), &recording, 1, nullptr, 0,
                          options.empty() ? nullptr : options.c_str(), &callbacks, &made);
  if (code < 0 || code > 4) {
    require_one_line(ik_result_message(made));
    std::abort();
  }
  if (code == 2) require_one_line(ik_result_message(made));
  const std::string json = ik_result_json(made);
  ik_filter* filter = nullptr;
  if (ik_filter_open(made, given[1].c_str(), &filter) == 0) {
    std::vector<double> y(ik_filter_outputs(filter), 1.0), u(ik_filter_inputs(filter), 0.5);
    for (int i = 0; i < 3; ++i) {
      ik_filter_step(filter, y.data(), u.data(), nullptr, nullptr, nullptr);
    }
  }
  ik_filter_free(filter);
  ik_result_free(made);
}

}  // namespace identikal::fuzz
