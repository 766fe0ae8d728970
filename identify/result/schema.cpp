#include "identify/result/schema.h"

#include <utility>

#include "identify/result/internal/schema_writer.h"
#include "identify/result/internal/version_1.h"
#include "identify/result/internal/whole_file.h"

namespace identikal {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kWidth = 160;  // of a line

Json shared_definitions() {
  const Json number = {{"$ref", "#/$defs/number"}};
  const Json row = {{"type", "array"}, {"items", number}};
  return {{"number", {{"type", Json::array({"number", "null"})}}},
          {"interval", {{"type", "array"}, {"items", number}, {"minItems", 2}, {"maxItems", 2}}},
          {"matrix",
           {{"description", "row by row; null: there is none"},
            {"type", Json::array({"array", "null"})},
            {"items", row}}},
          {"sha256", {{"type", "string"}, {"pattern", "^[0-9a-f]{64}$"}}}};
}

std::string in_one_line(const Json& value) {
  if (!value.is_structured()) return value.dump();
  std::string out;
  for (const auto& [key, member] : value.items()) {
    if (!out.empty()) out += ", ";
    if (value.is_object()) out += Json(key).dump() + ": ";
    out += in_one_line(member);
  }
  return value.is_object() ? "{" + out + "}" : "[" + out + "]";
}

// What fits stands in one line, and so do lists of texts: people read schemas too.
// @param margin  of the line that the value begins in; @param used  columns of it, the key's too
std::string laid_out(const Json& value, const std::string& margin, std::size_t used) {
  const std::string line = in_one_line(value);
  const bool of_texts = value.is_array() && !value.empty() && !value[0].is_structured();
  if (!value.is_structured() || of_texts || used + line.size() <= kWidth) return line;
  const std::string inner = margin + "  ";
  std::string out;
  for (const auto& [key, member] : value.items()) {
    const std::string begin = inner + (value.is_object() ? Json(key).dump() + ": " : "");
    out += (out.empty() ? "\n" : ",\n") + begin + laid_out(member, inner, begin.size() + 1);
  }
  out += "\n" + margin;
  return value.is_object() ? "{" + out + "}" : "[" + out + "]";
}

}  // namespace

std::string result_schema() {
  Json definitions = shared_definitions();
  SchemaWriter writer(definitions);
  Estimate any;
  WholeFile file = file_to_write({&any});
  describe(writer, file);
  Json out{{"$schema", "https://json-schema.org/draft/2020-12/schema"}, {"title", writer.name()}};
  out.update(writer.object());
  out["$defs"] = std::move(definitions);
  add_old_keys_to_schema(out);
  return laid_out(out, "", 0) + "\n";
}

}  // namespace identikal
