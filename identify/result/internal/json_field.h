// What is the value at one place of a file, and what is said where it is not as expected?
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

namespace identikal {

/// A value of a result with the way to it, e.g. "parameters[2].se", for messages. The file's JSON
/// and path outlive it. Every reading function throws InputError where the value is of another
/// kind.
class JsonField {
 public:
  using Json = nlohmann::ordered_json;

  /// @param way  empty: the whole file
  JsonField(const Json& value, std::string way, const std::string& path)
      : value_(value), way_(std::move(way)), path_(path) {}

  /// @param found  what is wrong with it: "is no text"
  [[noreturn]] void refuse(const std::string& found) const;

  JsonField operator[](const char* key) const;
  std::vector<JsonField> items() const;
  std::vector<std::pair<std::string, JsonField>> members() const;
  bool absent() const { return value_.is_null(); }
  std::string text() const;
  double number() const;  ///< null: kNone
  bool yes() const;
  template <class T>
  T whole_number() const {
    if (!value_.is_number_integer()) refuse("is no whole number");
    const bool fits = value_.is_number_unsigned() ? std::in_range<T>(value_.get<std::uint64_t>())
                                                  : std::in_range<T>(value_.get<std::int64_t>());
    if (!fits) refuse("is too large a number");
    return value_.get<T>();
  }
  /// @param known  values of an enumeration that to_string() names
  template <class Values>
  auto word(const Values& known) const {
    const std::string found = text();
    for (const auto each : known) {
      if (to_string(each) == found) return each;
    }
    refuse_word();
  }

 private:
  [[noreturn]] void refuse_word() const;

  const Json& value_;
  std::string way_;
  const std::string& path_;
};

/// A value as messages show it: in quotes where it is a text; on one line, not too long.
std::string shown(const nlohmann::ordered_json& value);

}  // namespace identikal
