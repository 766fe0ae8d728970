#include "identify/report/internal/text_layout.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace identikal {

std::string in_lines(std::string line, std::string_view words, std::size_t indent) {
  std::string out;
  for (std::size_t at = 0; at < words.size();) {
    const std::size_t end = std::min(words.find(' ', at), words.size());
    const std::string_view word = words.substr(at, end - at);
    at = end + 1;
    if (word.empty()) continue;
    const bool begun = !line.empty() && line.back() != ' ';
    if (begun && line.size() + 1 + word.size() > kLineWidth) {
      out += line + "\n";
      line = std::string(indent, ' ');
    } else if (begun) {
      line += ' ';
    }
    line += word;
  }
  return out + line + "\n";
}

std::string wrapped(const std::string& text, std::size_t indent) {
  const std::size_t begin = std::min(text.find_first_not_of(' '), text.size());
  const std::size_t end = std::min(text.find(' ', begin), text.size());
  return in_lines(text.substr(0, end), std::string_view(text).substr(end), indent);
}

std::string text_table(const std::vector<TableColumn>& columns,
                       const std::vector<std::vector<std::string>>& rows) {
  std::vector<std::size_t> width;
  for (const TableColumn& column : columns) width.push_back(column.heading.size());
  for (const std::vector<std::string>& row : rows) {
    for (std::size_t c = 0; c < width.size(); ++c) width[c] = std::max(width[c], row[c].size());
  }
  const std::size_t last = width.size() - 1;
  const std::size_t all = std::accumulate(width.begin(), width.end(), 2 * last);
  const std::string gap(all <= kLineWidth ? 2 : 1, ' ');
  const auto line = [&](const auto& cell) {
    std::string out;
    for (std::size_t c = 0; c < last; ++c) {
      out += (c > 0 ? gap : "") + (columns[c].left ? fmt::format("{:<{}}", cell(c), width[c])
                                                   : fmt::format("{:>{}}", cell(c), width[c]));
    }
    const std::string text = cell(last);
    if (out.size() + 2 + text.size() <= kLineWidth) return out + "  " + text + "\n";
    return out + "\n" + wrapped(std::string(width[0] + 1, ' ') + text, width[0] + 1);
  };
  std::string out = line([&](std::size_t c) { return columns[c].heading; });
  for (const std::vector<std::string>& row : rows) {
    out += line([&](std::size_t c) { return row[c]; });
  }
  return out;
}

std::string value_text(double value) {
  return !std::isfinite(value) ? "-" : fmt::format("{:.6g}", value);
}
std::string error_text(double value) {
  return !std::isfinite(value) ? "-" : fmt::format("{:.3g}", value);
}

std::string percent_text(double percent) {
  constexpr double kLeast = 1e-3;  // below, it is rounding, or as good as none
  if (percent < kLeast) return fmt::format("< {:g}", kLeast);
  return percent < 100.0 || percent > 1e6 ? fmt::format("{:.2g}", percent)
                                          : fmt::format("{:.0f}", percent);
}

namespace {

// "Q = 27 x 27, zero but for (1,1) 0.5, (2,2) 1"
std::string sparse_text(const std::string& name, const Eigen::MatrixXd& M) {
  std::string entries;
  for (Eigen::Index i = 0; i < M.rows(); ++i) {
    for (Eigen::Index j = 0; j < M.cols(); ++j) {
      if (M(i, j) == 0.0) continue;
      entries +=
          fmt::format("{}({},{}) {:.6g}", entries.empty() ? "" : ", ", i + 1, j + 1, M(i, j));
    }
  }
  return wrapped(fmt::format("{} = {} x {}, zero{}{}", name, M.rows(), M.cols(),
                             entries.empty() ? "" : " but for ", entries),
                 4);
}

}  // namespace

std::string matrix_text(const std::string& name, const Eigen::MatrixXd& given) {
  if (given.size() == 0) return "";
  constexpr double kRounding = 1e-20;  // of the largest entry: less is what is left of a zero
  const double least = kRounding * given.cwiseAbs().maxCoeff();
  const Eigen::MatrixXd M = (given.array().abs() < least).select(0.0, given);
  constexpr Eigen::Index kLarge = 36;
  if (M.size() > kLarge && 3 * (M.array() != 0.0).count() < M.size()) return sparse_text(name, M);
  std::string out = name + " = [";
  for (Eigen::Index i = 0; i < M.rows(); ++i) {
    for (Eigen::Index j = 0; j < M.cols(); ++j) {
      out += fmt::format("{}{:.6g}", j > 0 ? ", " : (i > 0 ? "; " : ""), M(i, j));
    }
  }
  return wrapped(out + "]", 4);
}

std::string comma_list(const std::vector<std::string>& names) {
  return fmt::format("{}", fmt::join(names, ", "));
}

}  // namespace identikal
