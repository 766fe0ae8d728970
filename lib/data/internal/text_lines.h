// Which lines of a table's text hold rows? Internal to lib: for the readers of tables.
#pragma once

#include <cstddef>
#include <string_view>
#include <vector>

#include "lib/data/internal/csv_cell.h"

namespace identikal::csv {

inline bool is_blank_text(std::string_view text) {
  return text.find_first_not_of(" \t\r\n") == std::string_view::npos;
}

inline bool is_comment(std::string_view line) {
  const std::size_t first = line.find_first_not_of(" \t");
  return first != std::string_view::npos && is_comment_sign(line[first]);
}

/// The last ones but blank ones and comments, upwards from the end: unlike the begin it holds rows and nothing else. Of a
/// short text the later half, as the header is among them.
/// @param end  behind a line feed
inline std::vector<std::string_view> last_lines(const char* begin, const char* end) {
  constexpr std::size_t kTailLines = 64;
  std::vector<std::string_view> lines;
  while (end != begin && lines.size() < kTailLines) {
    const char* start = end - 1;
    while (start != begin && start[-1] != '\n') --start;
    const std::string_view line(start, static_cast<std::size_t>(end - 1 - start));
    if (!is_blank_text(line) && !is_comment(line)) lines.push_back(line);
    end = start;
  }
  if (end == begin && !lines.empty()) lines.resize((lines.size() + 1) / 2);
  return lines;
}

}  // namespace identikal::csv
