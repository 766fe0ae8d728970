// Is a file still the one that a result was made from? Its bytes and their SHA-256.
#pragma once

#include <string>
#include <string_view>

namespace identikal {

/// SHA-256 of these bytes in hexadecimal.
std::string sha256_of_text(std::string_view text);

/// A file's bytes. @throws InputError, with what was expected and a hint, when it cannot be read.
std::string text_of_file(const std::string& path, const std::string& expected = "",
                         const std::string& hint = "");

/// SHA-256 of a file's bytes in hexadecimal. @throws InputError when it cannot be read.
///
/// Example:
///
///     for (const InputRecord& input : estimate.inputs) {
///       if (sha256_of_file(input.path) != input.sha256) std::puts("the data have changed");
///     }
std::string sha256_of_file(const std::string& path);

}  // namespace identikal
