#include "lib/base/error.h"

namespace identikal {
namespace {

std::string one_line(const Location& at, const std::string& found, const std::string& expected,
                     const std::string& hint) {
  std::string text;
  if (!at.path.empty()) {
    text += at.path;
    if (at.line > 0) text.append(":").append(std::to_string(at.line));
    if (at.line > 0 && at.column > 0) text.append(":").append(std::to_string(at.column));
    text += ": ";
  }
  text += found;
  if (!expected.empty()) text += "; expected " + expected;
  if (!hint.empty()) text += "; " + hint;
  // A quoted cell or key may hold control characters; the message stays one printable line.
  for (char& c : text) {
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = '?';
  }
  return text;
}

}  // namespace

InputError::InputError(const Location& at, const std::string& found, const std::string& expected,
                       const std::string& hint)
    : std::runtime_error(one_line(at, found, expected, hint)) {}

}  // namespace identikal
