// Which schema do described fields have?
#pragma once

#include <array>
#include <optional>
#include <string>
#include <type_traits>
#include <vector>

#include <nlohmann/json.hpp>

#include "identify/result/internal/fields.h"

namespace identikal {

/// Visitor of describe(): the JSON Schema of one object. Every struct has a definition of its own,
/// under its C++ name.
class SchemaWriter {
 public:
  using Json = nlohmann::ordered_json;

  /// @param definitions  "$defs" of the schema, which the structs that are met are added to
  explicit SchemaWriter(Json& definitions) : definitions_(definitions) {}

  void is(const char* name, const char* meaning) {
    name_ = name;
    meaning_ = meaning;
  }
  template <class T>
  void operator()(const char* key, T&& member, const char* meaning) {
    add(key, meaning, schema(member));
  }
  template <class Part>
  void group(const char* key, const char* meaning, const Part& part) {
    SchemaWriter inner(definitions_);
    part(inner);
    add(key, meaning, inner.object());
  }

  const std::string& name() const { return name_; }
  Json object() const {
    Json out;
    if (!meaning_.empty()) out["description"] = meaning_;
    out["type"] = "object";
    out["additionalProperties"] = false;
    out["required"] = required_;
    out["properties"] = properties_;
    return out;
  }

 private:
  void add(const char* key, const std::string& meaning, const Json& schema) {
    required_.emplace_back(key);
    Json& property = properties_[key];
    if (!meaning.empty()) property["description"] = meaning;
    property.update(schema);
  }

  static Json defined(const std::string& name) { return {{"$ref", "#/$defs/" + name}}; }
  static Json of_type(const char* type) { return {{"type", type}}; }
  static Json list_of(const Json& items) { return {{"type", "array"}, {"items", items}}; }

  static Json schema(double& /*any*/) { return defined("number"); }
  static Json schema(bool& /*any*/) { return of_type("boolean"); }
  static Json schema(std::string& /*any*/) { return of_type("string"); }
  template <class T>
  requires std::is_integral_v<T>
  static Json schema(T& /*any*/) { return of_type("integer"); }
  template <class T>
  requires std::is_enum_v<T>
  static Json schema(T& any) {
    Json words = Json::array();
    for (const T value : values_of(any)) words.push_back(to_string(value));
    return {{"enum", words}};
  }
  template <class T>
  Json schema(std::vector<T>& /*any*/) {
    T item{};
    return list_of(schema(item));
  }
  template <std::size_t n>
  static Json schema(std::array<double, n>& /*any*/) {
    if (n == 2) return defined("interval");
    Json out = list_of(defined("number"));
    out["minItems"] = out["maxItems"] = n;
    return out;
  }
  static Json schema(Eigen::VectorXd& /*any*/) { return list_of(defined("number")); }
  static Json schema(Eigen::MatrixXd& /*any*/) { return defined("matrix"); }
  template <class T>
  Json schema(std::optional<T>& /*any*/) {
    T part{};
    return {{"anyOf", {schema(part), of_type("null")}}};
  }
  template <class Struct>
  Json schema(Struct& any) {
    SchemaWriter inner(definitions_);
    describe(inner, any);
    definitions_[inner.name_] = inner.object();
    return defined(inner.name_);
  }

  template <class T>
  Json schema(Section<T>& /*any*/) {
    std::optional<T> part;
    return schema(part);
  }
  template <class T>
  static Json schema(Choice<T>& choice) {
    return {{"enum", choice.known}};
  }
  static Json schema(Present<double>& /*any*/) { return of_type("number"); }
  static Json schema(Present<std::string>& /*any*/) {
    return {{"type", "string"}, {"minLength", 1}};
  }
  static Json schema(ChoiceOrNull& choice) {
    Json known = Json::array({nullptr});
    for (const std::string& text : choice.known) known.push_back(text);
    return {{"enum", known}};
  }
  static Json schema(Sha256& /*any*/) { return defined("sha256"); }
  static Json schema(Ends& range) { return schema(range.ends); }
  static Json schema(CodeOf& /*any*/) { return of_type("string"); }
  Json schema(Printed& all) { return schema(all.findings); }
  Json schema(ByChannel& /*any*/) {
    ChannelFit fit;
    return {{"type", "object"}, {"additionalProperties", schema(fit)}};
  }

  Json& definitions_;
  std::string name_, meaning_;
  std::vector<std::string> required_;
  Json properties_;
};

}  // namespace identikal
