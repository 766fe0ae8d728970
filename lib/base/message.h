// How does a function report that an argument does not fit? One line with the numbers in it.
#pragma once

#include <concepts>
#include <initializer_list>
#include <string>
#include <string_view>
#include <variant>

namespace identikal {

/// A piece of a message: text or a number (six digits of one that is not whole). Text is not
/// copied.
class MessagePart {
 public:
  MessagePart(const char* text) : value_(std::string_view(text)) {}
  MessagePart(std::string_view text) : value_(text) {}
  MessagePart(const std::string& text) : value_(std::string_view(text)) {}
  template <std::integral Integer>
  MessagePart(Integer number) : value_(static_cast<long long>(number)) {}
  MessagePart(double number) : value_(number) {}
  void append_to(std::string& message) const;

 private:
  std::variant<std::string_view, long long, double> value_;
};

/// The parts run together.
std::string message(std::initializer_list<MessagePart> parts);

/// Does nothing where `holds`.
///
/// Example:
///
///     require_argument(y.rows() == 2, {"y has ", y.rows(), " rows; expected 2, r and vy"});
///
/// @throws std::invalid_argument with the parts run together otherwise
void require_argument(bool holds, std::initializer_list<MessagePart> parts);

}  // namespace identikal
