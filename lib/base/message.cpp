#include "lib/base/message.h"

#include <cstdio>
#include <stdexcept>

namespace identikal {

void MessagePart::append_to(std::string& message) const {
  if (const auto* text = std::get_if<std::string_view>(&value_)) {
    message += *text;
  } else if (const auto* whole = std::get_if<long long>(&value_)) {
    message += std::to_string(*whole);
  } else {
    char digits[32];
    std::snprintf(digits, sizeof(digits), "%g", std::get<double>(value_));
    message += digits;
  }
}

std::string message(std::initializer_list<MessagePart> parts) {
  std::string out;
  for (const MessagePart& part : parts) part.append_to(out);
  return out;
}

void require_argument(bool holds, std::initializer_list<MessagePart> parts) {
  if (!holds) throw std::invalid_argument(message(parts));
}

}  // namespace identikal
