#include "lib/data/text_table.h"

#include <algorithm>

#include "lib/data/internal/blank_separated.h"
#include "lib/data/internal/csv_cell.h"
#include "lib/data/internal/quoted_rows.h"

namespace identikal {
namespace {

// Takes the line at the begin of `rest`, without its end.
std::string_view next_line(std::string_view& rest) {
  const std::size_t end = rest.find('\n');
  std::string_view line = rest.substr(0, end);
  rest.remove_prefix(end == std::string_view::npos ? rest.size() : end + 1);
  if (line.ends_with('\r')) line.remove_suffix(1);
  return line;
}

bool is_skipped(std::string_view line) {
  return line.starts_with('#') || line.find_first_not_of(" \t") == std::string_view::npos;
}

char separator_of(std::string_view header) {
  const auto count = [&](char c) { return std::count(header.begin(), header.end(), c); };
  const char* const best = std::max(
      {",", ";", "\t"}, [&](const char* a, const char* b) { return count(*a) < count(*b); });
  return *best;
}

std::vector<std::string> cells_of(std::string_view line, char separator, const Location& at) {
  std::vector<std::string> out;
  for (const csv::Cell& cell : csv::split(line, separator)) {
    if (cell.bad_quote) {
      throw InputError({at.path, at.line, csv::character_position(line, cell.offset)},
                       "a quote that is not closed", "\"text\"");
    }
    out.push_back(csv::unescaped(cell.text));
  }
  return out;
}

void check_header(const TextTable& table, int line) {
  for (auto name = table.header.begin(); name != table.header.end(); ++name) {
    if (std::find(table.header.begin(), name, *name) == name) continue;
    throw InputError({table.path, line}, "two columns " + quoted_excerpt(*name),
                     "a name of its own for every column");
  }
}

}  // namespace

std::size_t TextTable::position(const std::string& name) const {
  return static_cast<std::size_t>(std::find(header.begin(), header.end(), name) - header.begin());
}

TextTable parse_text_table(std::string_view text, const std::string& path) {
  TextTable out;
  out.path = path;
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
  if (const std::size_t zero = text.find('\0'); zero != std::string_view::npos) {
    throw InputError({path}, "the file is binary", "a text file of columns");
  }
  char separator = ',';
  for (int line = 1; !text.empty(); ++line) {
    const std::string_view written = next_line(text);
    if (is_skipped(written)) continue;
    if (out.header.empty()) {
      separator = separator_of(written);
      out.header = cells_of(written, separator, {path, line});
      check_header(out, line);
      continue;
    }
    TextTable::Row row{line, cells_of(written, separator, {path, line})};
    if (row.cells.size() > out.header.size()) {
      throw InputError({path, line}, std::to_string(row.cells.size()) + " cells",
                       "at most " + std::to_string(out.header.size()) + ", as the header has");
    }
    row.cells.resize(out.header.size());
    out.rows.push_back(std::move(row));
  }
  if (out.header.empty()) throw InputError({path}, "the file is empty", "a header line and rows");
  return out;
}

std::vector<std::string> written_cells(std::string_view text, const Table& table,
                                       const Column& column) {
  const auto position = static_cast<std::size_t>(&column - table.columns.data());
  std::string plain(text);
  if (!plain.ends_with('\n')) plain += '\n';
  csv::unquote_rows(plain);
  csv::separate_at_blanks(plain);
  std::string_view rest = plain;
  std::vector<std::string> out;
  out.reserve(table.rows);
  int line = 0;
  for (std::size_t row = 0; row < table.rows; ++row) {
    std::string_view written;
    while (line < table.line_of_row(row)) {
      written = next_line(rest);
      ++line;
    }
    const std::vector<csv::Cell> cells = csv::split(written, table.separator);
    out.push_back(position < cells.size() ? csv::unescaped(cells[position].text) : std::string());
  }
  return out;
}

}  // namespace identikal
