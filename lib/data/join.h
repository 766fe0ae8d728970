// How do several files of one recording become one table?
#pragma once

#include <string>
#include <vector>

#include "lib/data/csv.h"
#include "lib/data/dataset.h"

namespace identikal {

/// The files that "imu.csv+can.csv+speed.csv" names. A file that really has a '+' in its name is
/// taken as it is, alone or as one of several.
/// @throws InputError for a name that is empty
std::vector<std::string> joined_files(const std::string& argument);

/// Columns of several files on the sampling grid of the first.
struct Joined {
  Table table;                     ///< rows, path and line numbers are those of the first file
  std::vector<std::size_t> file;   ///< of every column of the table, from 0
  std::vector<std::string> notes;  ///< what was interpolated, from which rate
};

/// Joins tables into one: the rows are those of the first table, its columns are as they were. The
/// columns of the others follow, without their time columns, each interpolated linearly between its
/// own neighbouring samples; in gaps wider than kBridgedPeriods of its own sampling periods, before
/// its first sample and after its last it is missing. One table alone comes back unchanged.
///
/// Every file needs a time column: the one of that name, else (but for the first) one that looks
/// like it. Times are compared in seconds: in the unit of the column's header, else `time.unit`,
/// else s. A column name that is in two files becomes `file.column` in both, `file` without
/// folder and ending, so that no one of the two is taken by chance.
///
/// Example:
///
///     std::vector<Table> tables;
///     for (const auto& path : joined_files("imu.csv+can.csv")) tables.push_back(read_csv(path));
///     const Joined joined = join_tables(tables, {.column = "time"});
///
/// @param time  its column may be empty: then every file's is the one that looks like it
/// @throws InputError for a file without time column, without two rows, with a time stamp that is
///   missing or does not increase, that has no time in common with the first, or twice the same
///   name of file where columns have to be told apart by it
Joined join_tables(const std::vector<Table>& tables, const TimeSource& time);

}  // namespace identikal
