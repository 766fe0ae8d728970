#include "lib/data/csv.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <map>
#include <memory>
#include <numeric>
#include <optional>
#include <utility>

#include "lib/base/constants.h"
#include "lib/data/internal/blank_separated.h"
#include "lib/data/internal/csv_cell.h"
#include "lib/data/internal/date_time.h"
#include "lib/data/internal/plain_number.h"
#include "lib/data/internal/quoted_rows.h"
#include "lib/data/internal/text_lines.h"
#include "lib/data/units.h"

namespace identikal {
namespace {

using namespace csv;

constexpr std::size_t kTextCheck = 65536;  // bytes at the start free of control codes

[[noreturn]] void throw_bad_quote(const Location& at, const Cell& cell) {
  throw InputError(at, "a quote that is not closed: " + quoted_excerpt(cell.text),
                   "a closing quote before the separator");
}

// --- The file ---

// The whole file, with a line feed after the last line so that every line ends in one.
struct Text {
  std::string bytes;
  const char* begin() const { return bytes.data(); }
  const char* end() const { return bytes.data() + bytes.size(); }
};

void check_is_text(const Text& text, const std::string& path) {
  const auto is_control = [](char c) {
    const auto byte = static_cast<unsigned char>(c);
    return byte == 0x7F || (byte < 0x20 && c != '\t' && c != '\n' && c != '\r');
  };
  const char* checked = text.begin() + std::min(text.bytes.size(), kTextCheck);
  const char* bad = std::find_if(text.begin(), checked, is_control);
  if (bad == checked) bad = std::find(checked, text.end(), '\0');
  if (bad != text.end()) {
    const std::string_view start(text.begin(), std::min<std::size_t>(text.bytes.size(), 2));
    const bool utf16 = start == "\xFF\xFE" || start == "\xFE\xFF";
    const char* line = bad;
    while (line != text.begin() && line[-1] != '\n') --line;
    char byte[8];
    std::snprintf(byte, sizeof byte, "0x%02X", static_cast<unsigned>(*bad) & 0xFFu);
    throw InputError({path, static_cast<int>(std::count(text.begin(), line, '\n')) + 1,
                      static_cast<int>(bad - line) + 1},
                     std::string("not a text file (byte ") + byte + ")",
                     "columns of numbers separated by comma, semicolon or tab",
                     utf16 ? "this looks like UTF-16: save it as UTF-8" : "");
  }
  const bool one_line = std::find(text.begin(), text.end(), '\n') == text.end() - 1;
  const char* carriage_return = std::find(text.begin(), text.end() - 1, '\r');
  if (one_line && carriage_return < text.end() - 2) {
    throw InputError({path, 1, static_cast<int>(carriage_return - text.begin()) + 1},
                     "a carriage return without a line feed", "lines that end in LF or CR LF");
  }
}

struct Line {
  std::string_view text;  // without its line feed
  int number = 0;
};

// Takes the line at `p` and moves `p` behind its line feed.
std::string_view next_line(const char*& p, const char* end) {
  const char* const begin = p;
  const char* const stop = std::find(begin, end, '\n');
  p = stop + 1;
  return {begin, static_cast<std::size_t>(stop - begin)};
}

// --- Layout: which line is the header, and where do the rows begin? ---

// What the end of the file shows; unlike the start it holds rows and nothing else.
struct Shape {
  char separator = ',';
  std::size_t width = 0;           // cells up to the last that is ever filled
  std::vector<bool> text_columns;  // columns in which most cells are text

  std::size_t fewest_cells() const { return width <= 1 ? 1 : 2; }  // of a header or a row
};

// The decimal mark of a number is decided by the first fraction.
DecimalMark initial_mark(char separator) {
  return separator == ',' ? DecimalMark::point : DecimalMark::undecided;
}

bool is_text(const Cell& cell, char separator) {
  return !is_missing(cell.text) && !parse_number(cell.text, initial_mark(separator));
}

Shape find_shape(const std::vector<std::string_view>& lines) {
  Shape best;
  std::array<int, 3> best_score{-1, 0, 0};  // most lines without text, numbers; fewest texts
  for (const char separator : {';', '\t', ','}) {
    Shape shape{.separator = separator, .width = 0, .text_columns = {}};
    std::vector<int> texts, seen;
    std::array<int, 3> score{};
    for (const std::string_view line : lines) {
      const std::vector<Cell> cells = split(line, separator);
      shape.width = std::max(shape.width, filled_width(cells));
      texts.resize(std::max(texts.size(), cells.size()));
      seen.resize(texts.size());
      bool text_free = true;
      for (std::size_t j = 0; j < cells.size(); ++j) {
        ++seen[j];
        if (is_text(cells[j], separator)) {
          ++texts[j];
          --score[2];
          text_free = false;
        } else if (!is_missing(cells[j].text)) {
          ++score[1];
        }
      }
      if (text_free) ++score[0];
    }
    // A separator that does not occur is no candidate; the comma stands for a single column.
    if ((texts.size() <= 1 && separator != ',') || score <= best_score) continue;
    for (std::size_t j = 0; j < texts.size(); ++j) {
      shape.text_columns.push_back(2 * texts[j] > seen[j]);
    }
    best = shape;
    best_score = score;
  }
  return best;
}

// What a line holds in the columns that are numeric: numbers alone, nothing, both, text alone.
enum class LineKind { numbers, missing, mixed, mostly_text, text };

LineKind kind_of(const std::vector<Cell>& cells, const Shape& shape) {
  std::size_t numbers = 0, texts = 0;
  for (std::size_t j = 0; j < cells.size(); ++j) {
    if (j < shape.text_columns.size() && shape.text_columns[j]) continue;
    if (is_missing(cells[j].text)) continue;
    ++(is_text(cells[j], shape.separator) ? texts : numbers);
  }
  if (texts == 0) return numbers > 0 ? LineKind::numbers : LineKind::missing;
  if (numbers == 0) return LineKind::text;
  return texts > numbers ? LineKind::mostly_text : LineKind::mixed;
}

// "[m/s]" or "(m/s)" -> "m/s"
std::string_view without_brackets(std::string_view text) {
  const bool bracketed = text.size() >= 2 && ((text.front() == '[' && text.back() == ']') ||
                                              (text.front() == '(' && text.back() == ')'));
  return bracketed ? trim(text.substr(1, text.size() - 2), '\0') : text;
}

// Units nearly throughout: one that is unknown must be named as such, not make the row a header.
bool is_unit_row(const std::vector<Cell>& cells, char separator) {
  std::size_t units = 0, filled = 0;
  for (const Cell& cell : cells) {
    if (cell.text.empty()) continue;
    if (cell.text != "1" && !is_text(cell, separator)) return false;
    ++filled;
    const std::string_view inner = without_brackets(cell.text);
    if (inner.size() != cell.text.size() || parse_unit(to_utf8(inner))) ++units;
  }
  return filled > 0 && 4 * units >= 3 * filled;
}

struct HeadLine {
  Line line;
  LineKind kind;
  std::size_t cells, filled;
  bool unit_row;
};

// The file down to its first rows. Blank lines are left out.
struct Head {
  std::vector<HeadLine> lines;
  std::vector<Line> comments;
  std::size_t first_numbers = 0;  // index into `lines` of a line that is a row beyond doubt
};

Head read_head(const char* begin, const char* end, const Shape& shape, const std::string& path) {
  Head head;
  const auto is_row = [&](const HeadLine& l) {
    return l.kind == LineKind::numbers && l.cells >= shape.fewest_cells();
  };
  int number = 1;
  for (const char* p = begin; p != end; ++number) {
    const Line line{next_line(p, end), number};
    if (is_blank_text(line.text)) continue;
    if (is_comment(line.text)) {
      head.comments.push_back(line);
      continue;
    }
    const std::vector<Cell> cells = split(line.text, shape.separator);
    head.lines.push_back({line, kind_of(cells, shape), cells.size(), filled_width(cells),
                          is_unit_row(cells, shape.separator)});
    // A single line of numbers may still be metadata; two of one width are rows.
    if (head.lines.size() < 2) continue;
    head.first_numbers = head.lines.size() - 2;
    const HeadLine &above = head.lines[head.first_numbers], &here = head.lines.back();
    const bool fits = here.kind == LineKind::numbers || here.kind == LineKind::missing;
    if (is_row(above) && fits && here.cells == above.cells) return head;
  }
  const bool last_is_row = !head.lines.empty() && is_row(head.lines.back());
  const auto row = last_is_row ? head.lines.end() - 1
                               : std::find_if(head.lines.begin(), head.lines.end(), is_row);
  if (row == head.lines.end()) {
    throw InputError({path, number - 1}, "the file ends without a row of numbers",
                     "a header line and rows of numbers");
  }
  head.first_numbers = static_cast<std::size_t>(row - head.lines.begin());
  return head;
}

struct Layout {
  std::optional<Line> header, units;
  Line first_row;
};

// "# t, y" directly above the rows, perhaps with "# s, m" between.
void take_header_from_comments(Text& text, const Head& head, const HeadLine& first_row,
                               const Shape& shape, Layout& layout) {
  const auto cells_of = [&](int number) {
    const auto comment = std::find_if(head.comments.begin(), head.comments.end(),
                                      [&](const Line& c) { return c.number == number; });
    std::vector<Cell> cells;
    if (comment == head.comments.end()) return std::pair{Line{}, cells};
    const std::size_t sign = comment->text.find_first_of(kCommentSigns);
    cells = split(comment->text.substr(sign + 1), shape.separator);
    // One column: a name is one word, anything longer is a remark.
    const std::string_view name = cells[0].text;
    const bool remark = shape.fewest_cells() == 1 && name.find(' ') != std::string_view::npos &&
                        !name.ends_with(']') && !name.ends_with(')');
    const bool fits = cells.size() == first_row.cells && kind_of(cells, shape) == LineKind::text;
    if (remark || !fits) cells.clear();
    return std::pair{*comment, cells};
  };
  const auto [near, near_cells] = cells_of(first_row.line.number - 1);
  if (near_cells.empty()) return;
  layout.header = near;
  const auto [far, far_cells] = cells_of(first_row.line.number - 2);
  if (is_unit_row(near_cells, shape.separator) && !far_cells.empty()) {
    layout.units = near;
    layout.header = far;
  }
  // With the sign blanked they are header lines like any other.
  for (const std::optional<Line>& line : {layout.header, layout.units}) {
    if (!line) continue;
    const std::size_t sign = line->text.find_first_of(kCommentSigns);
    text.bytes[static_cast<std::size_t>(line->text.data() - text.begin()) + sign] = ' ';
  }
}

Layout find_layout(Text& text, const Head& head, const Shape& shape) {
  // Up to the nearest line of text. Rows that it passes hold a text by mistake or are ragged; they
  // stay rows, so that reading them says so.
  const std::vector<HeadLine>& lines = head.lines;
  const auto may_be_header = [&](const HeadLine& l) {
    return l.kind == LineKind::text && l.cells >= shape.fewest_cells();
  };
  Layout layout;
  std::size_t top = 0;  // the first line that is a row
  for (std::size_t k = head.first_numbers; k-- > 0;) {
    if (lines[k].unit_row && k > 0 && may_be_header(lines[k - 1]) &&
        lines[k - 1].filled >= lines[k].filled) {
      layout.units = lines[k].line;
      layout.header = lines[k - 1].line;
    } else if (lines[k].kind != LineKind::text) {
      continue;
    } else if (may_be_header(lines[k])) {
      layout.header = lines[k].line;
    }
    top = k + 1;
    break;
  }
  if (!layout.header) {
    const std::size_t width = lines[head.first_numbers].cells;
    const auto has_text = [](const HeadLine& l) {
      return l.kind == LineKind::mixed || l.kind == LineKind::mostly_text;
    };
    while (has_text(lines[top]) && lines[top].cells != width) ++top;
    take_header_from_comments(text, head, lines[top], shape, layout);
  }
  // Some columns may be named by a number.
  if (!layout.header && lines[top].kind == LineKind::mostly_text) layout.header = lines[top++].line;
  layout.first_row = lines[top].line;
  return layout;
}

// All lines above the rows but the header, the units and blank ones.
std::vector<std::string> metadata_above(const char* begin, const Layout& layout) {
  std::vector<std::string> metadata;
  for (const char* p = begin; p != layout.first_row.text.data();) {
    const std::string_view line = next_line(p, layout.first_row.text.data());
    const bool used = (layout.header && layout.header->text.data() == line.data()) ||
                      (layout.units && layout.units->text.data() == line.data());
    if (!used && !is_blank_text(line)) metadata.push_back(to_utf8(trim(line, '\0')));
  }
  return metadata;
}

// --- Header and rows ---

void read_name(const std::string& cell, Column& column) {
  column.header = column.name = cell;
  std::size_t open = std::string::npos;
  if (cell.ends_with(']')) {
    open = cell.rfind('[');
  } else if (cell.ends_with(')')) {
    int depth = 0;
    for (open = cell.size(); open-- > 0;) {  // wraps round to npos when nothing opens it
      depth += cell[open] == ')' ? 1 : cell[open] == '(' ? -1 : 0;
      if (depth == 0) break;
    }
  } else if (const std::size_t comma = cell.rfind(','); comma != std::string::npos) {
    open = comma;
  }
  if (open == std::string::npos) return;
  const std::string_view name = trim(std::string_view(cell).substr(0, open), '\0');
  std::string_view unit = std::string_view(cell).substr(open + 1);
  if (cell[open] != ',') unit.remove_suffix(1);
  if (name.empty()) return;
  column.name = std::string(name);
  column.unit = std::string(trim(unit, '\0'));
}

std::vector<Column> read_header(const Layout& layout, const Shape& shape, const std::string& path) {
  const Line& shown = layout.header ? *layout.header : layout.first_row;
  const std::vector<Cell> cells = split(shown.text, shape.separator);
  if (cells.size() > kMaxColumns) {
    throw InputError({path, shown.number}, "more than " + std::to_string(kMaxColumns) + " columns",
                     "one row for each sample", "is the table transposed?");
  }
  for (const Cell& cell : cells) {
    if (!layout.header || !cell.bad_quote) continue;
    throw_bad_quote({path, shown.number, character_position(shown.text, cell.offset)}, cell);
  }
  // Empty cells at the end of the header are no columns unless the rows fill them.
  std::size_t width = filled_width(cells);
  if (shape.width <= cells.size()) width = std::max(width, shape.width);
  width = std::max<std::size_t>(width, 1);

  std::vector<Column> columns(width);
  std::map<std::string, int> uses;
  for (std::size_t j = 0; j < width; ++j) {
    if (layout.header) read_name(unescaped(cells[j].text), columns[j]);
    if (columns[j].name.empty()) columns[j].name = "column_" + std::to_string(j + 1);
    ++uses[columns[j].name];
  }
  // "v (raw)" and "v (filtered)", or "v [m/s]" and "v [km/h]": the whole cell is the name.
  for (Column& column : columns) {
    if (uses[column.name] > 1 && !column.header.empty()) column.name = column.header;
  }
  std::map<std::string, std::size_t> seen;
  for (std::size_t j = 0; j < width; ++j) {
    const auto [first, inserted] = seen.emplace(columns[j].name, j);
    if (inserted) continue;
    throw InputError({path, shown.number, character_position(shown.text, cells[j].offset)},
                     "column name " + quoted_excerpt(columns[j].name) +
                         " is a duplicate (columns " + std::to_string(first->second + 1) + " and " +
                         std::to_string(j + 1) + ")",
                     "a different name for each column");
  }
  if (layout.units) {
    const std::vector<Cell> units = split(layout.units->text, shape.separator);
    for (std::size_t j = 0; j < std::min(width, units.size()); ++j) {
      if (columns[j].unit.empty()) {
        columns[j].unit = unescaped(without_brackets(units[j].text));
      }
    }
  }
  return columns;
}

[[noreturn]] void throw_ragged(const Table& table, const Line& line, bool last) {
  const std::vector<Cell> cells = split(line.text, table.separator);
  const std::size_t columns = table.columns.size();
  const std::size_t offset =
      cells.size() > columns ? cells[columns].offset : trim(line.text, table.separator).size();
  const auto count = [](std::size_t n) {
    return n > kMaxColumns ? "more than " + std::to_string(kMaxColumns) + " cells"
                           : std::to_string(n) + (n == 1 ? " cell" : " cells");
  };
  throw InputError({table.path, line.number, character_position(line.text, offset)},
                   "row has " + count(cells.size()) + ", the " +
                       (table.has_header ? "header" : "first row") + " has " +
                       std::to_string(columns),
                   "as many cells in each row",
                   last && cells.size() < columns ? "is the file cut off here?" : "");
}

// What the double lacks of a whole number as it is written.
void keep_remainder(std::string_view text, std::size_t row, Column& column) {
  const std::optional<double> rest = remainder_of_whole(text, column.values[row]);
  if (!rest) return;
  if (column.remainder.empty()) column.remainder.assign(column.values.size(), 0.0);
  column.remainder[row] = *rest;
}

// Reads a cell of any kind, and notes in the column when it is no number, and among the dates what may be one.
double read_cell(const Line& line, std::size_t& pos, DecimalMark& mark, const Table& table,
                 std::size_t row, Column& column, DateColumn& dates) {
  const Cell cell = next_cell(line.text, pos, table.separator);
  const auto at = [&] { return character_position(line.text, cell.offset); };
  if (cell.bad_quote) throw_bad_quote({table.path, line.number, at()}, cell);
  if (const std::optional<double> value = parse_number(cell.text, mark)) {
    if (mark == DecimalMark::undecided) {
      if (cell.text.find('.') != std::string_view::npos) mark = DecimalMark::point;
      if (cell.text.find(',') != std::string_view::npos) mark = DecimalMark::comma;
    }
    return *value;
  }
  ++column.missing;
  column.infinite += same_ignoring_case(cell.text, "inf");
  if (is_missing(cell.text)) return kNaN;
  if (column.text_cells++ == 0) column.first_text = {line.number, at(), excerpt(cell.text)};
  dates.take(row, cell.text);
  return kNaN;
}

// Reads all rows from `p` on into the columns. `widest` is the number of cells, empty ones at the
// end included, that a row may have.
void read_rows(const char* p, const char* end, int number, std::size_t widest, Table& table) {
  const char separator = table.separator;
  const std::size_t width = table.columns.size();
  // Room for every line, but never for more cells than the bytes could hold: blank lines are cheap.
  const auto lines = static_cast<std::size_t>(std::count(p, end, '\n'));
  const std::size_t capacity = std::min(lines, static_cast<std::size_t>(end - p) / width + 1);
  std::vector<double*> out(width);
  for (std::size_t j = 0; j < width; ++j) {
    table.columns[j].values.resize(capacity);
    out[j] = table.columns[j].values.data();
  }
  std::vector<DateColumn> dates(width);
  DecimalMark mark = initial_mark(separator);
  std::size_t row = 0;
  bool in_run = false;
  std::size_t blank_lines = 0;  // since the last row
  // Among the rows of a single column, a blank line is an empty cell.
  const auto take_blank_lines = [&] {
    for (; width == 1 && blank_lines > 0; --blank_lines) {
      table.line_runs.push_back({row, number - static_cast<int>(blank_lines)});
      out[0][row++] = kNaN;
      ++table.columns[0].missing;
    }
    blank_lines = 0;
  };
  for (; p != end; ++number) {
    const char* const begin = p;
    while (is_blank(*p, separator)) ++p;
    if (*p == '\n' || is_comment_sign(*p)) {
      blank_lines += *p == '\n' ? 1 : 0;
      const std::string_view line = next_line(p, end);
      if (!line.empty()) table.metadata.push_back(to_utf8(trim(line, '\0')));
      in_run = false;
      continue;
    }
    take_blank_lines();
    if (!in_run) table.line_runs.push_back({row, number});
    in_run = true;

    Line whole{{}, number};  // its end is looked for only when a cell needs it
    const auto whole_line = [&]() -> const Line& {
      const char* from = begin;
      if (whole.text.data() == nullptr) whole.text = next_line(from, end);
      return whole;
    };
    const auto is_last = [&] { return whole_line().text.data() + whole.text.size() + 1 == end; };
    for (std::size_t j = 0; j < width; ++j) {
      if (j > 0) {
        if (*p == '\n') throw_ragged(table, whole_line(), is_last());
        ++p;
      }
      while (is_blank(*p, separator)) ++p;
      // Nearly every cell is a plain number; anything else takes the slow way.
      if (mark != DecimalMark::undecided) {
        const char* after =
            plain_number(p, end, mark == DecimalMark::comma ? ',' : '.', out[j][row]);
        if (std::abs(out[j][row]) > kWholeDoubles) {
          keep_remainder({p, static_cast<std::size_t>(after - p)}, row, table.columns[j]);
        }
        while (is_blank(*after, separator)) ++after;
        if (after != p && (*after == separator || *after == '\n')) {
          p = after;
          continue;
        }
      }
      auto pos = static_cast<std::size_t>(p - begin);
      out[j][row] = read_cell(whole_line(), pos, mark, table, row, table.columns[j], dates[j]);
      if (std::abs(out[j][row]) > kWholeDoubles) {
        auto from = static_cast<std::size_t>(p - begin);
        keep_remainder(next_cell(whole_line().text, from, separator).text, row, table.columns[j]);
      }
      p = begin + pos;
    }
    for (std::size_t cells = width; *p == separator && cells < widest; ++cells) {
      ++p;
      while (is_blank(*p, separator)) ++p;
    }
    if (*p != '\n') throw_ragged(table, whole_line(), false);
    ++p;
    ++row;
  }
  take_blank_lines();
  table.rows = row;
  table.decimal_comma = mark == DecimalMark::comma;
  for (std::size_t j = 0; j < width; ++j) {
    Column& column = table.columns[j];
    column.values.resize(row);
    if (!column.remainder.empty()) column.remainder.resize(row);
    dates[j].settle(column);
  }
}

// Behind the header of a single column, blank lines are rows too.
Line first_line_of_rows(const Layout& layout, std::size_t width) {
  const std::optional<Line>& above = layout.units ? layout.units : layout.header;
  if (width > 1 || !above) return layout.first_row;
  return {{above->text.data() + above->text.size() + 1, 0}, above->number + 1};
}

}  // namespace

std::string quoted_excerpt(std::string_view text) { return "'" + excerpt(text) + "'"; }

std::string read_csv_text(const std::string& path) {
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) {
    throw InputError({path}, "this is a directory", "a text file of columns");
  }
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(path.c_str(), "rb"),
                                                             &std::fclose);
  if (!file) {
    throw InputError({path}, std::string("cannot open the file: ") + std::strerror(errno));
  }
  // The size is only a first guess: a pipe has none, and a log may still be growing.
  std::error_code no_size;
  const std::uintmax_t guess = std::filesystem::file_size(path, no_size);
  std::string text(std::max<std::size_t>(no_size ? 0 : static_cast<std::size_t>(guess), 4096) + 1,
                   '\0');
  std::size_t size = 0;
  for (;;) {
    size += std::fread(text.data() + size, 1, text.size() - size, file.get());
    if (size < text.size()) break;
    // Not a text, and perhaps without an end (/dev/zero); parse_csv() says so.
    if (text.find('\0') < 4096) break;
    text.resize(2 * text.size());
  }
  if (std::ferror(file.get()) != 0) {
    throw InputError({path}, std::string("cannot read the file: ") + std::strerror(errno));
  }
  text.resize(size);
  return text;
}

Table read_csv(const std::string& path) { return parse_csv(read_csv_text(path), path); }

Table parse_csv(std::string bytes, const std::string& path) {
  Text text{std::move(bytes)};
  if (!text.bytes.empty() && text.bytes.back() != '\n') text.bytes += '\n';
  const char* begin = text.begin() + (text.bytes.starts_with("\xEF\xBB\xBF") ? 3 : 0);
  if (is_blank_text({begin, text.end()})) {
    throw InputError({path}, "the file is empty", "a header line and rows of numbers");
  }
  check_is_text(text, path);
  unquote_rows(text.bytes);
  const bool blanks = separate_at_blanks(text.bytes);
  const Shape shape = find_shape(last_lines(begin, text.end()));
  const Layout layout = find_layout(text, read_head(begin, text.end(), shape, path), shape);

  Table table;
  table.path = path;
  table.separator = shape.separator;
  table.blanks = blanks;
  table.has_header = layout.header.has_value();
  if (layout.header) table.header_line = layout.header->number;
  if (layout.units) table.unit_line = layout.units->number;
  table.columns = read_header(layout, shape, path);
  table.metadata = metadata_above(begin, layout);
  const Line& shown = layout.header ? *layout.header : layout.first_row;
  const std::size_t written = split(shown.text, shape.separator).size();
  const Line rows = first_line_of_rows(layout, table.columns.size());
  read_rows(rows.text.data(), text.end(), rows.number, std::max(written, table.columns.size() + 1),
            table);
  return table;
}

}  // namespace identikal
