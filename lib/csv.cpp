#include "lib/csv.h"

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
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <string_view>
#include <utility>

#include "lib/units.h"

namespace identikal {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr std::size_t kMaxColumns = 10000;
constexpr std::size_t kMaxExcerpt = 40;  // characters of the file that a message may quote
constexpr std::size_t kTailLines = 64;   // lines at the end of the file that show its shape
constexpr std::size_t kTextCheck = 1
                                   << 16;  // bytes at the start that must be free of control codes

// --- Text
// -------------------------------------------------------------------------------------------

bool is_continuation(char c) { return (static_cast<unsigned char>(c) & 0xC0) == 0x80; }

bool is_utf8(std::string_view text) {
  for (std::size_t i = 0; i < text.size();) {
    const auto lead = static_cast<unsigned char>(text[i]);
    const std::size_t length = lead < 0x80                   ? 1
                               : lead >= 0xC2 && lead < 0xE0 ? 2
                               : lead >= 0xE0 && lead < 0xF0 ? 3
                               : lead >= 0xF0 && lead < 0xF5 ? 4
                                                             : 0;
    if (length == 0 || i + length > text.size()) return false;
    for (std::size_t k = 1; k < length; ++k) {
      if (!is_continuation(text[i + k])) return false;
    }
    // Overlong forms, surrogates and code points beyond U+10FFFF.
    const auto second = static_cast<unsigned char>(length > 1 ? text[i + 1] : 0);
    if ((lead == 0xE0 && second < 0xA0) || (lead == 0xED && second > 0x9F) ||
        (lead == 0xF0 && second < 0x90) || (lead == 0xF4 && second > 0x8F)) {
      return false;
    }
    i += length;
  }
  return true;
}

// Measuring programs on Windows write a degree sign as Latin-1; reports need UTF-8.
std::string to_utf8(std::string_view text) {
  if (is_utf8(text)) return std::string(text);
  std::string out;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte < 0x80) {
      out += c;
    } else {
      out += static_cast<char>(0xC0 | (byte >> 6));
      out += static_cast<char>(0x80 | (byte & 0x3F));
    }
  }
  return out;
}

std::string excerpt(std::string_view text) {
  const std::string converted = to_utf8(text);
  std::size_t characters = 0;
  for (std::size_t i = 0; i < converted.size(); ++i) {
    if (is_continuation(converted[i])) continue;
    if (characters++ == kMaxExcerpt) return converted.substr(0, i) + "...";
  }
  return converted;
}

std::string in_quotes(std::string_view text) { return "'" + excerpt(text) + "'"; }

// Position in characters, from 1, of the byte at `offset`.
int character_position(std::string_view line, std::size_t offset) {
  const std::string_view before = line.substr(0, offset);
  if (!is_utf8(before)) return static_cast<int>(offset) + 1;
  return static_cast<int>(std::count_if(before.begin(), before.end(),
                                        [](char c) { return !is_continuation(c); })) +
         1;
}

bool is_blank(char c, char separator) {
  return c == ' ' || c == '\r' || (c == '\t' && separator != '\t');
}

std::string_view trim(std::string_view text, char separator) {
  while (!text.empty() && is_blank(text.front(), separator)) text.remove_prefix(1);
  while (!text.empty() && is_blank(text.back(), separator)) text.remove_suffix(1);
  return text;
}

bool same_ignoring_case(std::string_view a, std::string_view b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](char x, char y) {
    return std::tolower(static_cast<unsigned char>(x)) ==
           std::tolower(static_cast<unsigned char>(y));
  });
}

// --- Cells
// ------------------------------------------------------------------------------------------

struct Cell {
  std::string_view text;   // without blanks around it and without its quotes
  std::size_t offset = 0;  // of its first character in the line
  bool bad_quote = false;  // a quote that is not closed, or text after the closing quote
};

// Takes the cell that starts at `pos` and moves `pos` to the separator after it or to the line's
// end.
Cell next_cell(std::string_view line, std::size_t& pos, char separator) {
  while (pos < line.size() && is_blank(line[pos], separator)) ++pos;
  Cell cell{{}, pos, false};
  if (pos < line.size() && line[pos] == '"') {
    std::size_t close = line.find('"', pos + 1);
    while (close != std::string_view::npos && close + 1 < line.size() && line[close + 1] == '"') {
      close = line.find('"', close + 2);
    }
    if (close != std::string_view::npos) {
      std::size_t after = close + 1;
      while (after < line.size() && is_blank(line[after], separator)) ++after;
      if (after == line.size() || line[after] == separator) {
        cell.text = trim(line.substr(pos + 1, close - pos - 1), separator);
        pos = after;
        return cell;
      }
    }
    cell.bad_quote = true;
  }
  const std::size_t end = std::min(line.find(separator, pos), line.size());
  cell.text = trim(line.substr(pos, end - pos), separator);
  pos = end;
  return cell;
}

// At most kMaxColumns + 1 cells, which is enough to tell that there are too many.
std::vector<Cell> split(std::string_view line, char separator) {
  std::vector<Cell> cells;
  for (std::size_t pos = 0; cells.size() <= kMaxColumns; ++pos) {
    cells.push_back(next_cell(line, pos, separator));
    if (pos >= line.size()) break;
  }
  return cells;
}

std::string unescaped(std::string_view text) {
  std::string out;
  for (std::size_t i = 0; i < text.size(); ++i) {
    out += text[i];
    if (text[i] == '"' && i + 1 < text.size() && text[i + 1] == '"') ++i;
  }
  return to_utf8(out);
}

// Cells up to the last one that is not empty.
std::size_t filled_width(const std::vector<Cell>& cells) {
  std::size_t width = cells.size();
  while (width > 0 && cells[width - 1].text.empty()) --width;
  return width;
}

enum class DecimalMark { undecided, point, comma };

bool is_missing(std::string_view text) {
  if (text.size() > 4) return false;
  constexpr std::array<std::string_view, 6> kWords{"", "nan", "-nan", "na", "n/a", "null"};
  return std::any_of(kWords.begin(), kWords.end(),
                     [text](std::string_view word) { return same_ignoring_case(text, word); });
}

std::optional<double> parse_number(std::string_view text, DecimalMark mark) {
  if (text.empty()) return std::nullopt;
  // from_chars reads "inf" and "nan", which are no numbers here, and refuses a plus sign.
  const bool sign = text[0] == '+' || text[0] == '-';
  if (text.substr(sign ? 1 : 0).find_first_of("0123456789.,") != 0) return std::nullopt;
  if (text[0] == '+') text.remove_prefix(1);

  std::array<char, 64> buffer;
  const std::size_t comma = text.find(',');
  if (comma != std::string_view::npos) {
    if (mark == DecimalMark::point || text.size() > buffer.size()) return std::nullopt;
    if (text.find('.') != std::string_view::npos) return std::nullopt;
    std::copy(text.begin(), text.end(), buffer.begin());
    buffer[comma] = '.';
    text = std::string_view(buffer.data(), text.size());
  } else if (mark == DecimalMark::comma && text.find('.') != std::string_view::npos) {
    return std::nullopt;
  }
  double value = 0.0;
  const auto [stop, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (stop != text.data() + text.size()) return std::nullopt;
  if (error == std::errc::result_out_of_range) {
    // Too small is zero to the last bit; too large is no number.
    const bool tiny =
        text.find("e-") != std::string_view::npos || text.find("E-") != std::string_view::npos;
    return tiny ? std::optional(text[0] == '-' ? -0.0 : 0.0) : std::nullopt;
  }
  if (error != std::errc{} || !std::isfinite(value)) return std::nullopt;
  return value;
}

// --- The file
// ---------------------------------------------------------------------------------------

// The whole file, with a line feed after the last line so that every line ends in one.
struct Text {
  std::unique_ptr<char[]> bytes;
  std::size_t size = 0;
  const char* begin() const { return bytes.get(); }
  const char* end() const { return bytes.get() + size; }
};

Text read_file(const std::string& path) {
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
  std::size_t capacity = no_size ? 0 : static_cast<std::size_t>(guess);
  capacity = std::max<std::size_t>(capacity, 4096) + 2;
  Text text{std::make_unique_for_overwrite<char[]>(capacity), 0};
  for (;;) {
    text.size += std::fread(text.bytes.get() + text.size, 1, capacity - 1 - text.size, file.get());
    if (text.size < capacity - 1) break;
    auto larger = std::make_unique_for_overwrite<char[]>(2 * capacity);
    std::copy(text.begin(), text.end(), larger.get());
    text.bytes = std::move(larger);
    capacity *= 2;
  }
  if (std::ferror(file.get()) != 0) {
    throw InputError({path}, std::string("cannot read the file: ") + std::strerror(errno));
  }
  if (text.size > 0 && text.bytes[text.size - 1] != '\n') text.bytes[text.size++] = '\n';
  return text;
}

void check_is_text(const Text& text, const std::string& path) {
  const auto is_control = [](char c) {
    const auto byte = static_cast<unsigned char>(c);
    return byte == 0x7F || (byte < 0x20 && c != '\t' && c != '\n' && c != '\r' && c != '\f');
  };
  const char* checked = text.begin() + std::min(text.size, kTextCheck);
  const char* bad = std::find_if(text.begin(), checked, is_control);
  if (bad == checked) bad = std::find(checked, text.end(), '\0');
  if (bad != text.end()) {
    const std::string_view start(text.begin(), std::min<std::size_t>(text.size, 2));
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

bool is_blank_line(std::string_view line) {
  return std::all_of(line.begin(), line.end(),
                     [](char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\f'; });
}

bool is_comment(std::string_view line) {
  const std::size_t first = line.find_first_not_of(" \t");
  return first != std::string_view::npos && line[first] == '#';
}

// --- Layout: which line is the header, and where do the rows begin?
// ---------------------------------

// What the end of the file shows; unlike the start it holds rows and nothing else.
struct Shape {
  char separator = ',';
  std::size_t width = 0;           // cells up to the last that is ever filled
  std::vector<bool> text_columns;  // columns in which most cells are text
};

std::vector<std::string_view> last_lines(const char* begin, const char* end) {
  std::vector<std::string_view> lines;
  while (end != begin && lines.size() < kTailLines) {
    const char* start = end - 1;
    while (start != begin && start[-1] != '\n') --start;
    const std::string_view line(start, static_cast<std::size_t>(end - 1 - start));
    if (!is_blank_line(line) && !is_comment(line)) lines.push_back(line);
    end = start;
  }
  // In a short file the header is among them: keep the later half.
  if (end == begin && !lines.empty()) lines.resize((lines.size() + 1) / 2);
  return lines;
}

// The decimal mark of a number is decided by the first fraction, except where the comma separates.
DecimalMark initial_mark(char separator) {
  return separator == ',' ? DecimalMark::point : DecimalMark::undecided;
}

bool is_text(const Cell& cell, char separator) {
  return !is_missing(cell.text) && !parse_number(cell.text, initial_mark(separator));
}

Shape find_shape(const std::vector<std::string_view>& lines) {
  Shape best;
  std::pair<int, int> best_score{-1, 0};  // most numbers, then fewest texts
  for (const char separator : {';', '\t', ','}) {
    Shape shape{separator, 0, {}};
    std::vector<int> texts, seen;
    std::pair<int, int> score{0, 0};
    for (const std::string_view line : lines) {
      const std::vector<Cell> cells = split(line, separator);
      shape.width = std::max(shape.width, filled_width(cells));
      texts.resize(std::max(texts.size(), cells.size()));
      seen.resize(texts.size());
      for (std::size_t j = 0; j < cells.size(); ++j) {
        ++seen[j];
        if (is_text(cells[j], separator)) {
          ++texts[j];
          --score.second;
        } else if (!is_missing(cells[j].text)) {
          ++score.first;
        }
      }
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

// What a line holds in the columns that are numeric: only numbers (or missing), only text, or both.
enum class LineKind { numbers, missing, mixed, text };

LineKind kind_of(const std::vector<Cell>& cells, const Shape& shape) {
  bool number = false, text = false;
  for (std::size_t j = 0; j < cells.size(); ++j) {
    if (j < shape.text_columns.size() && shape.text_columns[j]) continue;
    if (is_missing(cells[j].text)) continue;
    (is_text(cells[j], shape.separator) ? text : number) = true;
  }
  if (text) return number ? LineKind::mixed : LineKind::text;
  return number ? LineKind::numbers : LineKind::missing;
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

struct Layout {
  std::optional<Line> header, units;
  Line first_row;
  std::vector<std::string> metadata;  // all lines above the rows but header, units and blanks
};

struct HeadLine {
  Line line;
  LineKind kind;
  std::size_t cells, filled;
  bool unit_row;
};

Layout find_layout(const Text& text, const char* begin, const Shape& shape,
                   const std::string& path) {
  // Down to the first two rows in a row: a single line of numbers may still be metadata.
  std::vector<HeadLine> lines;
  std::vector<Line> comments;
  std::size_t first = 0;
  bool found = false;
  int number = 1;
  const std::size_t fewest = shape.width <= 1 ? 1 : 2;  // cells of a header or row
  const auto is_row = [&](const HeadLine& l) {
    return l.kind == LineKind::numbers && l.cells >= fewest;
  };
  for (const char* p = begin; p != text.end() && !found; ++number) {
    const char* end = std::find(p, text.end(), '\n');
    const Line line{std::string_view(p, static_cast<std::size_t>(end - p)), number};
    p = end + 1;
    if (is_blank_line(line.text)) continue;
    if (is_comment(line.text)) {
      comments.push_back(line);
      continue;
    }
    const std::vector<Cell> cells = split(line.text, shape.separator);
    lines.push_back({line, kind_of(cells, shape), cells.size(), filled_width(cells),
                     is_unit_row(cells, shape.separator)});
    if (lines.size() < 2) continue;
    const HeadLine &above = lines[lines.size() - 2], &here = lines.back();
    if (is_row(above) && here.cells == above.cells &&
        (here.kind == LineKind::numbers || here.kind == LineKind::missing)) {
      first = lines.size() - 2;
      found = true;
    }
  }
  if (!found) {
    const auto row = !lines.empty() && is_row(lines.back())
                         ? lines.end() - 1
                         : std::find_if(lines.begin(), lines.end(), is_row);
    if (row == lines.end()) {
      const int last = std::max(lines.empty() ? 1 : lines.back().line.number,
                                comments.empty() ? 1 : comments.back().number);
      throw InputError({path, last}, "no row of numbers up to the end of the file",
                       "a header line and rows of numbers");
    }
    first = static_cast<std::size_t>(row - lines.begin());
  }

  // Up to the nearest line of text. Rows that it passes hold a text by mistake or are ragged; they
  // stay rows, so that reading them says so.
  const auto may_be_header = [&](const HeadLine& l) {
    return l.kind == LineKind::text && l.cells >= fewest;
  };
  Layout layout;
  std::size_t top = 0;  // first line that may be a row
  for (std::size_t k = first; k-- > 0;) {
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
    while (lines[top].kind == LineKind::mixed && lines[top].cells != lines[first].cells) ++top;
  }
  layout.first_row = lines[top].line;

  if (!layout.header) {
    // "# t, y" directly above the rows, perhaps with "# s, m" between.
    const auto take_comment = [&](int at, std::string_view& body) {
      const auto line = std::find_if(comments.begin(), comments.end(),
                                     [at](const Line& c) { return c.number == at; });
      if (line == comments.end()) return false;
      body = line->text.substr(line->text.find('#') + 1);
      const std::vector<Cell> cells = split(body, shape.separator);
      const bool prose = shape.width <= 1 && cells[0].text.find(' ') != std::string_view::npos &&
                         cells[0].text.back() != ')' && cells[0].text.back() != ']';
      return !prose && cells.size() == lines[top].cells && kind_of(cells, shape) == LineKind::text;
    };
    const int row = layout.first_row.number;
    std::string_view above, two_above;
    if (take_comment(row - 1, above)) {
      if (is_unit_row(split(above, shape.separator), shape.separator) &&
          take_comment(row - 2, two_above)) {
        layout.units = Line{above, row - 1};
        layout.header = Line{two_above, row - 2};
      } else {
        layout.header = Line{above, row - 1};
      }
    }
  }

  std::map<int, std::string_view> above;
  for (const HeadLine& l : lines) above.emplace(l.line.number, l.line.text);
  for (const Line& comment : comments) above.emplace(comment.number, comment.text);
  for (const auto& [at, line] : above) {
    const bool used = (layout.header && layout.header->number == at) ||
                      (layout.units && layout.units->number == at);
    if (at < layout.first_row.number && !used) layout.metadata.push_back(to_utf8(trim(line, '\0')));
  }
  return layout;
}

// --- Header
// -----------------------------------------------------------------------------------------

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
    if (layout.header && cell.bad_quote) {
      throw InputError({path, shown.number, character_position(shown.text, cell.offset)},
                       "a quote that is not closed: " + in_quotes(cell.text),
                       "a closing quote before the separator");
    }
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
                     "column name " + in_quotes(columns[j].name) + " stands twice (columns " +
                         std::to_string(first->second + 1) + " and " + std::to_string(j + 1) + ")",
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

// --- Rows
// -------------------------------------------------------------------------------------------

[[noreturn]] void throw_ragged(const Table& table, const Line& line) {
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
                   "as many cells in each row");
}

// Reads the number at `p` and returns where it stops; `p` itself when there is none. A line feed at
// `end[-1]` stops every loop.
const char* plain_number(const char* p, const char* end, char mark, double& value) {
  static constexpr double kTenTo[] = {1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,  1e8, 1e9,
                                      1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18};
  const char* const begin = p;
  const bool negative = *p == '-';
  if (negative) ++p;
  const auto digit = [](char c) { return static_cast<unsigned>(c) - '0'; };
  std::uint64_t mantissa = 0;
  const char* const digits = p;
  for (; digit(*p) < 10; ++p) mantissa = 10 * mantissa + digit(*p);
  std::ptrdiff_t count = p - digits, decimals = 0;
  if (*p == mark) {
    const char* const fraction = ++p;
    for (; digit(*p) < 10; ++p) mantissa = 10 * mantissa + digit(*p);
    decimals = p - fraction;
    count += decimals;
  }
  // Both operands are exact doubles, so the one division rounds once: the result is the nearest
  // double (Clinger 1990). Eighteen digits cannot overflow the integer.
  const bool exponent = *p == 'e' || *p == 'E';
  if (count > 0 && count <= 18 && mantissa <= (std::uint64_t{1} << 53) && !exponent) {
    value = static_cast<double>(mantissa) / kTenTo[decimals];
    if (negative) value = -value;
    return p;
  }
  if (mark != '.') return begin;
  const auto [stop, error] = std::from_chars(begin, end, value);
  return error == std::errc{} && std::isfinite(value) ? stop : begin;
}

// Reads all rows from `p` on into the columns. `widest` is the number of cells, empty ones at the
// end included, that a row may have.
void read_rows(const char* p, const char* end, int line, std::size_t widest, Table& table) {
  const char separator = table.separator;
  const std::size_t width = table.columns.size();
  // Enough for every line, and never more than the bytes could hold (blank lines are cheap to
  // write).
  const auto lines = static_cast<std::size_t>(std::count(p, end, '\n'));
  const std::size_t capacity = std::min(lines, static_cast<std::size_t>(end - p) / width + 1);
  std::vector<double*> out(width);
  for (std::size_t j = 0; j < width; ++j) {
    table.columns[j].values.resize(capacity);
    out[j] = table.columns[j].values.data();
  }
  DecimalMark mark = initial_mark(separator);
  std::size_t row = 0;
  bool in_run = false;
  for (; p != end; ++line) {
    const char* const line_begin = p;
    while (is_blank(*p, separator)) ++p;
    if (*p == '\n' || *p == '#') {
      const char* line_end = std::find(p, end, '\n');
      if (*p == '#') {
        table.metadata.push_back(
            to_utf8(trim(std::string_view(p, static_cast<std::size_t>(line_end - p)), '\0')));
      }
      p = line_end + 1;
      in_run = false;
      continue;
    }
    if (!in_run) table.line_runs.push_back({row, line});
    in_run = true;

    std::string_view whole;  // the line, found only when a cell needs it
    const auto whole_line = [&] {
      if (whole.data() == nullptr) {
        const char* line_end = std::find(line_begin, end, '\n');
        whole = std::string_view(line_begin, static_cast<std::size_t>(line_end - line_begin));
      }
      return Line{whole, line};
    };
    for (std::size_t j = 0; j < width; ++j) {
      if (j > 0) {
        if (*p == '\n') throw_ragged(table, whole_line());
        ++p;
      }
      while (is_blank(*p, separator)) ++p;
      // Nearly every cell is a plain number; anything else takes the slow way.
      if (mark != DecimalMark::undecided) {
        double value;
        const char* after = plain_number(p, end, mark == DecimalMark::comma ? ',' : '.', value);
        while (is_blank(*after, separator)) ++after;
        if (after != p && (*after == separator || *after == '\n')) {
          out[j][row] = value;
          p = after;
          continue;
        }
      }
      const Line here = whole_line();
      std::size_t pos = static_cast<std::size_t>(p - line_begin);
      const Cell cell = next_cell(here.text, pos, separator);
      p = line_begin + pos;
      const auto at = [&] { return character_position(here.text, cell.offset); };
      if (cell.bad_quote) {
        throw InputError({table.path, line, at()},
                         "a quote that is not closed: " + in_quotes(cell.text),
                         "a closing quote before the separator");
      }
      const std::optional<double> value = parse_number(cell.text, mark);
      out[j][row] = value.value_or(kNaN);
      if (value) {
        if (mark == DecimalMark::undecided) {
          if (cell.text.find('.') != std::string_view::npos) mark = DecimalMark::point;
          if (cell.text.find(',') != std::string_view::npos) mark = DecimalMark::comma;
        }
        continue;
      }
      Column& column = table.columns[j];
      ++column.missing;
      if (is_missing(cell.text)) continue;
      if (column.text_cells++ == 0) column.first_text = {line, at(), excerpt(cell.text)};
    }
    std::size_t cells = width;
    while (*p == separator && cells < widest) {
      ++cells;
      ++p;
      while (is_blank(*p, separator)) ++p;
    }
    if (*p != '\n') throw_ragged(table, whole_line());
    ++p;
    ++row;
  }
  table.rows = row;
  table.decimal_comma = mark == DecimalMark::comma;
  for (Column& column : table.columns) column.values.resize(row);
}

}  // namespace

int Table::line_of_row(std::size_t row) const {
  const auto after =
      std::upper_bound(line_runs.begin(), line_runs.end(), row,
                       [](std::size_t r, const LineRun& run) { return r < run.row; });
  if (after == line_runs.begin()) return 0;
  const LineRun& run = *std::prev(after);
  return run.line + static_cast<int>(row - run.row);
}

const Column* Table::find(const std::string& name) const {
  for (const Column& column : columns) {
    if (column.name == name) return &column;
  }
  for (const Column& column : columns) {
    if (!column.header.empty() && column.header == name) return &column;
  }
  const Column* found = nullptr;
  for (const Column& column : columns) {
    if (!same_ignoring_case(column.name, name)) continue;
    if (found != nullptr) return nullptr;
    found = &column;
  }
  if (found != nullptr) return found;
  std::size_t number = 0;
  const auto [stop, error] = std::from_chars(name.data(), name.data() + name.size(), number);
  const bool whole = error == std::errc{} && stop == name.data() + name.size();
  return whole && number >= 1 && number <= columns.size() ? &columns[number - 1] : nullptr;
}

std::vector<std::string> Table::column_names() const {
  std::vector<std::string> names;
  for (const Column& column : columns) names.push_back(column.name);
  return names;
}

Table read_csv(const std::string& path) {
  const Text text = read_file(path);
  const std::string_view bytes(text.begin(), text.size);
  const char* begin = text.begin() + (bytes.starts_with("\xEF\xBB\xBF") ? 3 : 0);
  if (bytes.substr(static_cast<std::size_t>(begin - text.begin())).find_first_not_of(" \t\r\n\f") ==
      std::string_view::npos) {
    throw InputError({path}, "the file is empty", "a header line and rows of numbers");
  }
  check_is_text(text, path);
  const Shape shape = find_shape(last_lines(begin, text.end()));
  Layout layout = find_layout(text, begin, shape, path);

  Table table;
  table.path = path;
  table.separator = shape.separator;
  table.has_header = layout.header.has_value();
  table.columns = read_header(layout, shape, path);
  table.metadata = std::move(layout.metadata);
  const Line& shown = layout.header ? *layout.header : layout.first_row;
  const std::size_t written = split(shown.text, shape.separator).size();
  read_rows(layout.first_row.text.data(), text.end(), layout.first_row.number,
            std::max(written, table.columns.size() + 1), table);
  return table;
}

}  // namespace identikal
