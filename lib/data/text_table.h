// Which texts stand in a table? For lists of files and names, where a recording (lib/data/csv.h) has numbers.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "lib/data/csv.h"

namespace identikal {

/// A file of cells below a header. Blank lines and those that start with '#' are skipped.
struct TextTable {
  std::string path;
  std::vector<std::string> header;
  struct Row {
    int line = 0;                    ///< of the file, from 1
    std::vector<std::string> cells;  ///< as many as the header has
  };
  std::vector<Row> rows;

  /// Where the column of that name stands; header.size() when there is none.
  std::size_t position(const std::string& name) const;
};

/// Reads a comma, semicolon or tab separated file: the separator is that of the header.
///
/// Example:
///
///     const TextTable list = parse_text_table("recording,unit\na.csv,car 1\n", "fleet.csv");
///     std::puts(list.rows[0].cells[list.position("unit")].c_str());  // car 1
///
/// @param path  for messages
/// @throws InputError  with path, line and column for an empty file, a quote that is not closed, a
///   name that occurs twice, and a row that is longer than the header; a shorter one is filled up
TextTable parse_text_table(std::string_view text, const std::string& path);

/// The cells of a column as they are written, row by row of a table that parse_csv() has read: names
/// of vehicles where the table has NaN.
/// @param text  that the table was read from
std::vector<std::string> written_cells(std::string_view text, const Table& table,
                                       const Column& column);

}  // namespace identikal
