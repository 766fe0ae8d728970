// How do numbers, sentences and tables look on a console of 80 columns?
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

namespace identikal {

inline constexpr std::size_t kLineWidth = 80;

/// The line with these words behind it, broken at blanks so that none is longer than the page; the
/// lines that follow are indented. A line that ends in a blank begins a column: the first word
/// stands right there.
std::string in_lines(std::string line, std::string_view words, std::size_t indent);

/// The same for a text whose first word begins the line.
std::string wrapped(const std::string& text, std::size_t indent);

struct TableColumn {
  std::string heading;
  bool left = false;  ///< text; numbers stand on the right
};

/// Columns as wide as what they hold, two blanks apart, or one where the page is too narrow. The last
/// one is text: where a line would still be longer than the page, it stands on the next line.
std::string text_table(const std::vector<TableColumn>& columns,
                       const std::vector<std::vector<std::string>>& rows);

/// An estimate with six digits, its standard error with three; "-" where there is none.
std::string value_text(double value);
std::string error_text(double value);

/// Two digits of a percentage; below a thousandth "< 0.001".
std::string percent_text(double percent);

/// "Q = [1, 0; 0, 2]"; a large one that is mostly zero by its other entries; nothing for an empty one.
std::string matrix_text(const std::string& name, const Eigen::MatrixXd& M);

/// "a, b, c".
std::string comma_list(const std::vector<std::string>& names);

}  // namespace identikal
