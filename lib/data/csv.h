// What does this text file of columns hold? Reads a recording as it is: no unit is converted and no
// sample is invented; that is lib/data/dataset.h.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "lib/base/error.h"

namespace identikal {

/// A cell that is not a number, kept so that an error can name it if the column is used.
struct TextCell {
  int line = 0;      ///< line of the file, from 1
  int column = 0;    ///< position in the line in characters, from 1
  std::string text;  ///< UTF-8, cut to 40 characters
};

/// What a column of dates and times holds.
enum class Dates {
  none,      ///< it is no such column
  instants,  ///< dates, with or without a time of day: `values` are seconds since 1970-01-01 in UTC
  times_of_day,  ///< hours, minutes and seconds: seconds since the first midnight
  ambiguous,     ///< 3/4/2024, and nothing says which number is the day: text
};

struct Column {
  std::string name;    ///< header without its unit; "column_3" when there is none
  std::string header;  ///< the header cell as written; empty when there is none
  std::string unit;    ///< as written in the header or the unit row; empty when none is given
  std::vector<double> values;  ///< as in the file; NaN for an empty cell, nan, NA, null or text
  /// Of a column with whole numbers beyond 2^53, as nanoseconds since 1970 are, and of dates: what
  /// each value lacks of the number as written. Empty for others.
  std::vector<double> remainder;
  std::size_t missing = 0;     ///< how many values are NaN
  std::size_t text_cells = 0;  ///< how many cells are neither a number nor missing
  std::size_t infinite = 0;    ///< how many of them are "inf", which a time may be
  TextCell first_text;         ///< the first of them, or the first date
  Dates dates = Dates::none;
  int months = 0;  ///< of dates that are so many months apart: taken as equally far; else 0
};

/// Every cell is a number or missing; dates are none.
inline bool holds_numbers(const Column& column) {
  return column.text_cells == 0 && column.dates == Dates::none;
}

struct Table {
  std::string path;
  std::vector<Column> columns;
  std::vector<std::string> metadata;  ///< lines before the header, and comments, as written
  std::size_t rows = 0;
  char separator = ',';
  bool blanks = false;  ///< columns are separated by blanks alone, which count as a tab
  bool decimal_comma = false;
  bool has_header = false;
  int header_line = 0;  ///< line of the header; 0 when there is none
  int unit_line = 0;    ///< line of the row of units below it; 0 when there is none

  /// Line of the file on which data row `row` (from 0) stands.
  int line_of_row(std::size_t row) const;
  /// The column of that name (as named, then as written in the header, then ignoring case); nullptr
  /// when there is none or case alone leaves a choice. A name that is a whole number n and matches
  /// no header means the n-th column, from 1.
  const Column* find(const std::string& name) const;
  std::vector<std::string> column_names() const;

  /// Runs of rows without a blank or comment line between them: first row and its line.
  struct LineRun {
    std::size_t row;
    int line;
  };
  std::vector<LineRun> line_runs;
};

/// A row of a column of dates or times of day in words: 2024-01-31 12:30:05.25, in UTC; or
/// 12:30:05. Of months the first alone is the date as written: they are equally long.
std::string date_text(const Column& column, std::size_t row);

/// These rows of a table, on their lines of the file.
Table rows_at(const Table& table, const std::vector<std::size_t>& rows);
/// Rows [first, first + count).
Table rows_of(const Table& table, std::size_t first, std::size_t count);

/// `text` in single quotes and in UTF-8, cut to 40 characters: how a message quotes a file.
std::string quoted_excerpt(std::string_view text);

/// Reads a file separated by comma, semicolon, tab, or blanks where there is nothing else between
/// numbers; tests/lib/data/csv_test.cpp shows every form of header, unit, comment and number that it
/// knows. In short:
/// - a row has a number in most columns that are numeric at the end of the file. The line of text
///   nearest above the first row is the header (`name`, `name [unit]`, `name (unit)` or
///   `"NAME, unit"`), or the unit row below it; what stands before is metadata. Without one, a '#'
///   or '%' line directly above the first row with as many fields is the header.
/// - lines that start with '#' or '%' are skipped anywhere, and so are blank lines, except below
///   the header of a single column, or its first row: there a blank line is an empty cell.
/// - an empty cell, nan, NA or null is missing; anything else that is not a finite number is text,
///   but in a column whose every cell is a date (2024-01-31, 31.01.2024, 31-Jan-2024, 1/31/2024;
///   with 12:30:05.25, pm, Z or +02:00 behind it) or a time of day: those are numbers of seconds.
/// - a decimal comma is possible where the separator is not the comma; the first fraction decides.
/// - header, text and metadata are given in UTF-8; a file that is not UTF-8 is taken as Latin-1.
///
/// Example:
///
///     const Table table = read_csv("drive.csv");
///     const Column* yaw_rate = table.find("yaw_rate");  // nullptr when there is none
///     if (yaw_rate) std::printf("%zu rows [%s]\n", table.rows, yaw_rate->unit.c_str());
///
/// @throws InputError  with path, line and column for a file that cannot be opened, a directory, an
///   empty file, a header without rows, a duplicate column name, a ragged row, a quote that
///   is not closed, a binary file, or more than 10000 columns.
Table read_csv(const std::string& path);

/// The two steps of it: the file's bytes, and what they say. @param path  for messages
std::string read_csv_text(const std::string& path);
Table parse_csv(std::string text, const std::string& path);

}  // namespace identikal
