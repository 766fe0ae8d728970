// What was typed? The options of every verb.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "lib/data/dataset.h"

namespace identikal {

/// As given, or the defaults; what belongs to other verbs than `verb` keeps its default.
struct Arguments {
  std::string verb, model;
  std::vector<std::string> data;
  std::string output, report;
  std::string command;  // as typed, for the report
  bool json = false, strict = false, quiet = false;
  std::int64_t seed = 1;
  int starts = 5, runs = 0, threads = 0, bootstrap = 0;
  std::vector<std::string> settings;
  std::string path = "automatic";
  std::string method = "ml", accuracy, place = "both", hold_out;
  std::string language, least_fit;
  int order = 4;
  bool regain = false, robust = false, adaptive = false;
  bool vehicle = false;
  bool compare = false, full_matrix = false, sources = false;
  long lags = 0, draws = 0;
  std::string range, manoeuvre, speed, rate = "100 Hz", duration, snr;
  std::vector<std::string> manoeuvre_settings, signals;
  std::string filter;
  long rows = 0;
  bool smooth = false;
  long lag = -1;  // fixed-lag smoother; -1: not asked for
  std::string from;
};

/// @return none when the answer has been printed: --help, --version
/// @throws InputError for an unknown verb or option and values that do not fit; OutputError
std::optional<Arguments> parse_command_line(int argc, char** argv);

/// "12", "12s", "60 km/h" in SI.
/// @param option  for the message
/// @param kind    a unit of the quantity expected, in which a bare number is
/// @throws InputError
double quantity(const std::string& option, const std::string& text, const std::string& kind);

/// "70%", "70" as 0.7. @throws InputError for "0.7" too, which could be 70 % or less than one
double percentage(const std::string& option, const std::string& text);

/// "10s:95s", "10s:", ":95s"; empty: everything. @throws InputError
TimeRange parse_range(const std::string& text);

/// On standard output. @throws OutputError when it takes no more, as on a full disk
void print(const std::string& text);

}  // namespace identikal
