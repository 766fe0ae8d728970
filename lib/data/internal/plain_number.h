// Which number stands here, read as fast as can be? Internal to lib: for lib/data/csv.cpp only.
#pragma once

#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

namespace identikal::csv {

// Reads the number at `p` and returns where it stops; `p` itself when there is none. A line feed at
// `end[-1]` stops every loop.
inline const char* plain_number(const char* p, const char* end, char mark, double& value) {
  static constexpr double kTenTo[] = {1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,  1e8, 1e9,
                                      1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18};
  const char* const begin = p;
  const bool negative = *p == '-';
  if (negative) ++p;
  const auto digit = [](char c) { return static_cast<unsigned>(c) - '0'; };
  std::uint64_t mantissa = 0;
  const char* const digits = p;
  for (; digit(*p) < 10; ++p) mantissa = 10 * mantissa + digit(*p);
  std::ptrdiff_t count = p - digits, decimals = 0;
  if (*p == mark) {
    const char* const fraction = ++p;
    for (; digit(*p) < 10; ++p) mantissa = 10 * mantissa + digit(*p);
    decimals = p - fraction;
    count += decimals;
  }
  // Both operands are exact doubles, so the one division rounds once: the result is the nearest
  // double (Clinger 1990). Eighteen digits cannot overflow the integer.
  const bool exponent = *p == 'e' || *p == 'E';
  if (count > 0 && count <= 18 && mantissa <= (std::uint64_t{1} << 53) && !exponent) {
    value = static_cast<double>(mantissa) / kTenTo[decimals];
    if (negative) value = -value;
    return p;
  }
  if (mark != '.') return begin;
  const auto [stop, error] = std::from_chars(begin, end, value);
  return error == std::errc{} && std::isfinite(value) ? stop : begin;
}

constexpr double kWholeDoubles =
    9007199254740992.0;  // 2^53: whole numbers beyond need be no doubles

// What `value` lacks of the whole number that the text is; nothing when it is none of 64 bits.
inline std::optional<double> remainder_of_whole(std::string_view text, double value) {
  if (!(std::abs(value) < 9.2e18)) return std::nullopt;
  if (!text.empty() && text[0] == '+') text.remove_prefix(1);
  std::int64_t whole = 0;
  const auto [stop, error] = std::from_chars(text.data(), text.data() + text.size(), whole);
  if (error != std::errc{} || stop != text.data() + text.size()) return std::nullopt;
  return static_cast<double>(whole - static_cast<std::int64_t>(value));
}

}  // namespace identikal::csv
