// Are the columns of a table parted by blanks alone? Internal to lib: for the readers of tables.
#pragma once

#include <string>

namespace identikal::csv {

/// Where the last lines hold numbers, dates and nothing else with blanks between them, equally many:
///
///     #  t    speed [km/h]
///        0.0  60.1
///        0.1  60.3
///
/// the first blank between two of them becomes a tab, so that every character keeps its place in messages; in the header
/// and its units alike, but not between a name and its unit, nor between a date and its time of day. Anything else stays
/// as it is.
/// @param text  ends in a line feed
/// @return whether it was so
bool separate_at_blanks(std::string& text);

}  // namespace identikal::csv
