#include "lib/data/internal/blank_separated.h"

#include <algorithm>
#include <cstddef>
#include <string_view>
#include <vector>

#include "lib/data/internal/csv_cell.h"
#include "lib/data/internal/date_time.h"
#include "lib/data/internal/text_lines.h"

namespace identikal::csv {
namespace {

std::vector<std::string_view> words_of(std::string_view line) {
  std::vector<std::string_view> out;
  for (std::size_t at = 0; (at = line.find_first_not_of(" \r", at)) != std::string_view::npos;) {
    const std::size_t end = std::min(line.find_first_of(" \r", at), line.size());
    out.push_back(line.substr(at, end - at));
    at = end;
  }
  return out;
}

// A comma behind it would be a separator.
bool is_number(std::string_view word) {
  if (word.ends_with(',')) return false;
  return is_missing(word) || parse_number(word, DecimalMark::undecided);
}
bool is_time(std::string_view word) {
  return word.find(',') == std::string_view::npos && written_time(word);
}
bool is_date(std::string_view word) { return is_time(word) && written_time(word)->has_day; }

// With a date that has its time of day behind it as one.
std::vector<std::string_view> cells_of(std::string_view line) {
  std::vector<std::string_view> out;
  for (const std::string_view word : words_of(line)) {
    const bool goes_on = !out.empty() && is_date(out.back()) && is_time(word) && !is_date(word);
    if (!goes_on) {
      out.push_back(word);
      continue;
    }
    const char* const begin = out.back().data();
    out.back() = {begin, static_cast<std::size_t>(word.data() + word.size() - begin)};
  }
  return out;
}

// Names: a word in brackets is a unit, and belongs to the name before it.
std::vector<std::string_view> names_of(std::string_view line) {
  std::vector<std::string_view> out;
  for (const std::string_view word : words_of(line)) {
    const bool is_unit = !out.empty() && (word.front() == '[' || word.front() == '(');
    if (!is_unit) out.push_back(word);
  }
  return out;
}

bool are_numbers_and_dates(std::string_view line) {
  if (line.find_first_of("\t;\"") != std::string_view::npos) return false;
  return std::ranges::all_of(words_of(line), [](auto w) { return is_number(w) || is_time(w); });
}

void put_tabs(const std::vector<std::string_view>& cells, std::string& text) {
  for (std::size_t k = 1; k < cells.size(); ++k)
    text[static_cast<std::size_t>(cells[k].data() - text.data()) - 1] = '\t';
}

// The names above columns of which one is a date and a time of day, each with a name of its own: "date time" is one.
std::vector<std::string_view> joined_as(std::string_view row, std::vector<std::string_view> names) {
  const std::vector<std::string_view> words = words_of(row), cells = cells_of(row);
  if (names.size() != words.size()) return names;
  std::vector<std::string_view> out;
  std::size_t cell = 0;
  for (std::size_t k = 0; k < words.size(); ++k) {
    if (cell == cells.size() || words[k].data() != cells[cell].data()) continue;
    out.push_back(names[k]);
    ++cell;
  }
  return out;
}

}  // namespace

bool separate_at_blanks(std::string& text) {
  const std::vector<std::string_view> rows = last_lines(text.data(), text.data() + text.size());
  const std::size_t width = rows.empty() ? 0 : cells_of(rows.front()).size();
  if (width < 2) return false;
  const bool is_so = std::ranges::all_of(rows, [&](std::string_view line) {
    return cells_of(line).size() == width && are_numbers_and_dates(line);
  });
  if (!is_so) return false;
  const std::string a_row(rows.front());
  bool is_below_header = false;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    std::string_view line(text.data() + begin, end - begin);
    begin = end + 1;
    const bool comments = is_comment(line);
    if (comments && is_below_header) continue;
    if (comments) line.remove_prefix(line.find_first_of(kCommentSigns) + 1);
    const std::vector<std::string_view> names = joined_as(a_row, names_of(line));
    const bool is_row = are_numbers_and_dates(line) && !names.empty();
    is_below_header = is_below_header || (is_row && !comments);
    if (is_row) {
      put_tabs(cells_of(line), text);
    } else if (names.size() == width) {
      put_tabs(names, text);
    }
  }
  return true;
}

}  // namespace identikal::csv
