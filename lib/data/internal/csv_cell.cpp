#include "lib/data/internal/csv_cell.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>

#include "lib/base/utf8.h"

namespace identikal::csv {
namespace {

constexpr std::size_t kMaxExcerpt = 40;  // characters of the file that a message may quote

}  // namespace

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
  std::string converted = to_utf8(text);
  std::size_t characters = 0;
  for (std::size_t i = 0; i < converted.size(); ++i) {
    if (is_utf8_continuation(converted[i])) continue;
    if (characters++ == kMaxExcerpt) return converted.substr(0, i) + "...";
  }
  return converted;
}

int character_position(std::string_view line, std::size_t offset) {
  const std::string_view before = line.substr(0, offset);
  if (!is_utf8(before)) return static_cast<int>(offset) + 1;
  return static_cast<int>(std::count_if(before.begin(), before.end(),
                                        [](char c) { return !is_utf8_continuation(c); })) +
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

std::size_t filled_width(const std::vector<Cell>& cells) {
  std::size_t width = cells.size();
  while (width > 0 && cells[width - 1].text.empty()) --width;
  return width;
}

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

}  // namespace identikal::csv
