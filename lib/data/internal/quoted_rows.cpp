#include "lib/data/internal/quoted_rows.h"

#include <algorithm>
#include <cctype>
#include <string_view>
#include <vector>

namespace identikal::csv {
namespace {

constexpr std::size_t kLooked = 20;  // lines at the end that show what the file is like

// The first and the last character of a line but for blanks; its end where there are none.
struct Extent {
  std::size_t first, last;
};

Extent extent_of(std::string_view line) {
  const std::size_t first = line.find_first_not_of(" \t\r");
  if (first == std::string_view::npos) return {line.size(), line.size()};
  return {first, line.find_last_not_of(" \t\r")};
}

// One quoted cell from end to end; inside of it quotes are doubled.
bool is_one_cell(std::string_view line) {
  const auto [first, last] = extent_of(line);
  if (last >= line.size() || last <= first || line[first] != '"' || line[last] != '"') return false;
  for (std::size_t i = first + 1; i < last; ++i) {
    if (line[i] != '"') continue;
    if (i + 1 >= last || line[i + 1] != '"') return false;
    ++i;
  }
  return true;
}

std::size_t separators_in(std::string_view line) {
  std::size_t most = 0;
  for (const char separator : {';', '\t', ','}) {
    most =
        std::max(most, static_cast<std::size_t>(std::count(line.begin(), line.end(), separator)));
  }
  return most;
}

std::vector<std::string_view> lines_of(const std::string& text) {
  std::vector<std::string_view> out;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    const std::string_view line(text.data() + begin, end - begin);
    if (const auto [first, last] = extent_of(line); last < line.size()) out.push_back(line);
    begin = end + 1;
  }
  return out;
}

// A single comma between digits is a decimal one, unless the first line has names on both sides
// ("y, m" is a name and its unit).
bool has_two_names(std::string_view line) {
  return separators_in(line) > 0 && line.find(", ") == std::string_view::npos &&
         std::any_of(line.begin(), line.end(),
                     [](unsigned char c) { return std::isalpha(c) != 0; });
}

}  // namespace

void unquote_rows(std::string& text) {
  // Of nearly every file the last character but blanks says that it is not like that.
  const std::size_t end = text.find_last_not_of(" \t\r\n");
  if (end == std::string::npos || text[end] != '"') return;
  const std::vector<std::string_view> lines = lines_of(text);
  const auto tail = lines.end() - static_cast<std::ptrdiff_t>(std::min(kLooked, lines.size()));
  const bool all = std::all_of(tail, lines.end(), is_one_cell);
  if (lines.empty() || !all) return;
  const std::size_t separators = separators_in(lines.back());
  const bool decimals = separators == 1 && lines.back().find(',') != std::string_view::npos;
  if (separators == 0 || (decimals && !has_two_names(lines.front()))) return;
  for (const std::string_view line : lines) {
    if (!is_one_cell(line)) continue;
    const auto [first, last] = extent_of(line);
    char* const begin = text.data() + (line.data() - text.data());
    begin[first] = begin[last] = ' ';
    for (std::size_t i = first + 1; i < last; ++i) {
      if (begin[i] == '"') begin[i++] = ' ';  // the second of two stays
    }
  }
}

}  // namespace identikal::csv
