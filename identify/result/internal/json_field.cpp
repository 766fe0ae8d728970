#include "identify/result/internal/json_field.h"

#include <fmt/format.h>

#include "identify/estimate/none.h"
#include "lib/base/error.h"

namespace identikal {

void JsonField::refuse(const std::string& found) const {
  throw InputError({path_, 0, 0}, fmt::format("'{}' {}", way_, found),
                   "a result.json as -o writes it", "run the job again with -o");
}

void JsonField::refuse_word() const { refuse("is " + shown(value_)); }

JsonField JsonField::operator[](const char* key) const {
  const std::string way = way_.empty() ? key : way_ + "." + key;
  if (!value_.is_object()) refuse("is no object");
  const auto at = value_.find(key);
  if (at == value_.end()) JsonField(value_, way, path_).refuse("is missing");
  return {*at, way, path_};
}

std::vector<JsonField> JsonField::items() const {
  if (!value_.is_array()) refuse("is no list");
  std::vector<JsonField> out;
  for (const Json& item : value_) {
    out.emplace_back(item, fmt::format("{}[{}]", way_, out.size()), path_);
  }
  return out;
}

std::vector<std::pair<std::string, JsonField>> JsonField::members() const {
  if (!value_.is_object()) refuse("is no object");
  std::vector<std::pair<std::string, JsonField>> out;
  for (const auto& [key, item] : value_.items()) {
    out.emplace_back(key, JsonField(item, way_ + "." + key, path_));
  }
  return out;
}

std::string JsonField::text() const {
  if (!value_.is_string()) refuse("is no text");
  return value_.get<std::string>();
}

double JsonField::number() const {
  if (absent()) return kNone;
  if (!value_.is_number()) refuse("is no number");
  return value_.get<double>();
}

bool JsonField::yes() const {
  if (!value_.is_boolean()) refuse("is neither true nor false");
  return value_.get<bool>();
}

std::string shown(const nlohmann::ordered_json& value) {
  constexpr std::size_t kLongest = 40;
  const std::string text =
      value.dump(-1, ' ', true, nlohmann::ordered_json::error_handler_t::replace);
  return text.size() <= kLongest ? text : text.substr(0, kLongest) + "...";
}

}  // namespace identikal
