// Which rows of a recording are meant: "series = 17 and speed > 5"? For fleet alone.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "lib/data/csv.h"

namespace identikal {

/// The rows for which a condition holds: comparisons (=, !=, <, <=, >, >=) of a column with a number
/// or a text, joined by "and". A missing value is in none of them.
/// @param text  that the table was read from
/// @throws InputError for a condition that cannot be read, a column that is not there, and one that
///   no row meets
std::vector<std::size_t> rows_where(const std::string& condition, std::string_view text,
                                    const Table& table);

/// Rows that have the same value in a column, in the order in which the values come.
struct RowGroup {
  std::string value;
  std::vector<std::size_t> rows;
};

/// @param rows  among these
/// @throws InputError for a column that is not there, and for a row without a value
std::vector<RowGroup> groups_by(const std::string& column, std::string_view text,
                                const Table& table, const std::vector<std::size_t>& rows);

}  // namespace identikal
