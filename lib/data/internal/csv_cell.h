// What does one cell of a text line hold? Cutting a line at its separators, quotes, numbers, and
// text that may be quoted in a message. Internal to lib: for lib/data/csv.cpp only.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "lib/base/error.h"

namespace identikal::csv {

inline constexpr std::size_t kMaxColumns = 10000;
inline constexpr std::string_view kCommentSigns = "#%";  // of shells, and of MATLAB

inline bool is_comment_sign(char c) { return kCommentSigns.find(c) != std::string_view::npos; }

/// The text itself when it is UTF-8, else read as Latin-1: measuring programs on Windows write a
/// degree sign so.
std::string to_utf8(std::string_view text);
/// At most 40 characters of the file, to be quoted in a message.
std::string excerpt(std::string_view text);
/// Position in characters, from 1, of the byte at `offset`.
int character_position(std::string_view line, std::size_t offset);
bool is_blank(char c, char separator);
std::string_view trim(std::string_view text, char separator);
bool same_ignoring_case(std::string_view a, std::string_view b);

struct Cell {
  std::string_view text;   ///< without blanks around it and without its quotes
  std::size_t offset = 0;  ///< of its first character in the line
  bool bad_quote = false;  ///< a quote that is not closed, or text after the closing quote
};

/// Takes the cell that starts at `pos` and moves `pos` to the separator after it or to the line's
/// end.
Cell next_cell(std::string_view line, std::size_t& pos, char separator);
/// At most kMaxColumns + 1 cells, which is enough to tell that there are too many.
std::vector<Cell> split(std::string_view line, char separator);
/// A quoted cell's text with its doubled quotes made single, as UTF-8.
std::string unescaped(std::string_view text);
/// Cells up to the last one that is not empty.
std::size_t filled_width(const std::vector<Cell>& cells);

enum class DecimalMark { undecided, point, comma };

/// Empty, "nan", "NA", "n/a" or "null" in any case.
bool is_missing(std::string_view text);
/// The finite number that the whole text is; nothing when it is none, or has the other decimal
/// mark.
std::optional<double> parse_number(std::string_view text, DecimalMark mark);

}  // namespace identikal::csv
