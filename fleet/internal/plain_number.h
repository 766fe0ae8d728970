// Is this text a number, and which? For fleet alone.
#pragma once

#include <charconv>
#include <cmath>
#include <optional>
#include <string>

namespace identikal {

/// The finite number that the whole text is.
inline std::optional<double> plain_number(const std::string& text) {
  double value = 0.0;
  const auto [stop, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  const bool whole = error == std::errc{} && stop == text.data() + text.size();
  return whole && std::isfinite(value) ? std::optional(value) : std::nullopt;
}

}  // namespace identikal
