// Is this text UTF-8, and where do its characters begin?
#pragma once

#include <cstddef>
#include <string_view>

namespace identikal {

/// A byte inside a character, not its first.
bool is_utf8_continuation(char c);

/// Bytes of the character that begins at `at`; 0 when there is none. Overlong forms, surrogates and
/// code points beyond U+10FFFF are none: JSON could not hold them.
///
/// Example:
///
///     const std::string_view text = "20 °C";
///     const bool fine = is_utf8(text);
///     const std::size_t bytes = utf8_length(text, 3);  // 2: the sign of degrees
std::size_t utf8_length(std::string_view text, std::size_t at);

bool is_utf8(std::string_view text);

}  // namespace identikal
