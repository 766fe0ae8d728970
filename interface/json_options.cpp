#include "interface/json_options.h"

#include <algorithm>
#include <string_view>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "lib/base/error.h"
#include "lib/base/nearest_name.h"

namespace identikal {
namespace {

using Json = nlohmann::ordered_json;

// "hold-out" of "--hold-out", "output" of "-o,--output"; empty: a program cannot set it.
std::string_view key_of(const Option& option) {
  const std::string_view names = option.names;
  const bool of_a_terminal = names == "--json" || names == "--quiet";
  if (option.is_argument() || !option.now.empty() || of_a_terminal) return "";
  return names.substr(names.rfind(',') + 1).substr(2);
}

std::string text_of(const Json& value) {
  return value.is_string() ? value.get<std::string>() : value.dump();
}

void take_value(const Option& option, const std::string& key, const Json& value) {
  const auto refuse = [&](const char* expected) {
    throw InputError({}, fmt::format("option '{}' is {}", key, value.type_name()), expected);
  };
  if (option.is_flag()) {
    if (!value.is_boolean()) refuse("true or false");
    if (value.get<bool>()) take(option, "");
    return;
  }
  const std::vector<Json> values =
      value.is_array() ? value.get<std::vector<Json>>() : std::vector<Json>{value};
  if (value.is_array() && !option.is_list()) refuse("one value");
  for (const Json& each : values) {
    if (!each.is_string() && !each.is_number()) refuse("a text or a number");
    take(option, text_of(each));
  }
}

}  // namespace

void take_json_options(const Verb& verb, const std::string& text) {
  if (text == "{}") return;
  Json given;
  try {
    given = Json::parse(text);
  } catch (const Json::parse_error& error) {
    throw InputError({}, fmt::format("the options are no JSON: they break at byte {}", error.byte),
                     "{\"starts\": 1} or the like");
  } catch (const Json::out_of_range&) {
    throw InputError({}, "the options hold a number that is too large",
                     "{\"starts\": 1} or the like");
  }
  if (!given.is_object()) {
    throw InputError({}, "the options are no JSON object", "{\"starts\": 1} or the like");
  }
  for (const auto& [key, value] : given.items()) {
    const auto named = [&, &name = key](const Option& option) {
      return !name.empty() && key_of(option) == name;
    };
    const auto option = std::find_if(verb.options.begin(), verb.options.end(), named);
    if (option == verb.options.end()) {
      std::vector<std::string> names;
      for (const Option& each : verb.options) {
        if (!key_of(each).empty()) names.emplace_back(key_of(each));
      }
      throw InputError({}, fmt::format("unknown option '{}' of '{}'", key, verb.name), "",
                       did_you_mean(key, names));
    }
    take_value(*option, key, value);
  }
}

}  // namespace identikal
