// Has a program written every row of a table as one quoted cell? Internal to lib: for
// lib/data/csv.cpp only.
#pragma once

#include <string>

namespace identikal::csv {

/// Spreadsheets that take a file for a single column write its rows so:
///
///     "time,speed,""yaw rate, deg/s"""
///     "0.00,16.7,0.02"
///
/// Where the last lines all look like that, the quotes around rows are replaced by blanks, and
/// those doubled inside of them made single, so that every character keeps its place in messages.
/// Anything else stays as it is: a column of quoted decimal commas, a table with one quoted text.
void unquote_rows(std::string& text);

}  // namespace identikal::csv
