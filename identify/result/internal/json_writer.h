// What do described fields read like in JSON?
#pragma once

#include <array>
#include <cmath>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "identify/result/internal/fields.h"

namespace identikal {

/// Visitor of describe(): one JSON object. NaN and infinity become null, as do matrices without
/// entries and parts that are not there.
class JsonWriter {
 public:
  using Json = nlohmann::ordered_json;

  template <class Struct>
  static Json object_of(const Struct& s) {
    JsonWriter writer;
    // One description serves those who fill a struct and those who read it: it asks for a struct
    // that may change. This visitor changes nothing.
    describe(writer, const_cast<Struct&>(s));
    return std::move(writer.out_);
  }

  void is(const char* /*name*/, const char* /*meaning*/) {}
  template <class T>
  void operator()(const char* key, const T& member, const char* /*meaning*/) {
    out_[key] = json(member);
  }
  template <class Part>
  void group(const char* key, const char* /*meaning*/, const Part& part) {
    JsonWriter inner;
    part(inner);
    out_[key] = std::move(inner.out_);
  }

 private:
  static Json json(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }
  static Json json(const std::string& text) { return text; }
  template <class T>
  requires std::is_integral_v<T>
  static Json json(const T& value) { return value; }
  template <class T>
  requires std::is_enum_v<T>
  static Json json(const T& value) { return to_string(value); }
  template <class T>
  static Json json(const std::vector<T>& items) {
    return list(items);
  }
  template <std::size_t n>
  static Json json(const std::array<double, n>& items) {
    return list(items);
  }
  static Json json(const Eigen::VectorXd& items) { return list(items); }
  static Json json(const Eigen::MatrixXd& M) {
    if (M.size() == 0) return nullptr;
    Json rows = Json::array();
    for (const auto& row : M.rowwise()) rows.push_back(list(row));
    return rows;
  }
  template <class T>
  static Json json(const std::optional<T>& part) {
    return part ? json(*part) : Json(nullptr);
  }
  template <class Struct>
  static Json json(const Struct& s) {
    return object_of(s);
  }

  template <class T>
  static Json json(const Section<T>& section) {
    return section.held != nullptr ? json(*section.held) : Json(nullptr);
  }
  template <class T>
  static Json json(const Choice<T>& choice) {
    return json(choice.value);
  }
  template <class T>
  static Json json(const Present<T>& present) {
    return json(present.value);
  }
  static Json json(const ChoiceOrNull& choice) {
    return choice.text.empty() ? Json(nullptr) : Json(choice.text);
  }
  static Json json(const Sha256& sum) { return sum.text; }
  static Json json(const Ends& range) { return json(range.ends); }
  static Json json(const CodeOf& code) { return name_of(code.finding); }
  static Json json(const Printed& all) { return json(printed(all.findings)); }
  static Json json(const ByChannel& channels) {
    Json out = Json::object();
    for (const ChannelFit& fit : channels.fits) out[fit.channel] = json(fit);
    return out;
  }

  template <class List>
  static Json list(const List& items) {
    Json out = Json::array();
    for (const auto& item : items) out.push_back(json(item));
    return out;
  }

  Json out_;
};

}  // namespace identikal
