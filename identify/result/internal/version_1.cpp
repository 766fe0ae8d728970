#include "identify/result/internal/version_1.h"

#include <algorithm>
#include <iterator>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>

#include "identify/result/schema.h"

namespace identikal {
namespace {

using Json = nlohmann::ordered_json;

// Of the objects at a place: names of keys from the root, '*' for every item of a list.
struct RenamedKey {
  std::string_view place, before, now;
};
struct RenamedValue {
  std::string_view place, key, before, now;
};

// Outer keys before inner ones; places are named as in version 2.
constexpr RenamedKey kRenamedKeys[] = {
    {"", "course", "time_history"},
    {"", "sources", "minimum_rank"},
    {"minimum_rank", "picked", "rank"},
    {"minimum_rank/curve/*", "sources", "rank"},
    {"noise", "expected_loss", "excess_mean_square_error"},
    {"objective", "path", "evaluation_method"},
    {"objective", "path_reason", "evaluation_reason"},
    {"objective", "starts_agree", "starts_at_optimum"},
    {"identifiability", "cond", "condition"},
    {"identifiability", "flat_directions", "unidentifiable_directions"},
    {"shaping", "colour_p", "whiteness_p"},
    {"shaping", "place", "noise_source"},
    {"shaping/candidates/*", "place", "noise_source"},
    {"survey/relations/*", "size", "slope"},
    {"survey/findings/*", "do", "remedy"},
    {"warnings/*", "do", "remedy"},
};
constexpr RenamedKey kRenamedPageKeys[] = {
    {"", "course", "time_history"},
    {"", "washed_out", "high_pass_filtered"},
    {"channels/*", "free_run", "simulation"},
};
constexpr RenamedValue kRenamedValues[] = {
    {"status", "code", "answer_no", "rejected"},
    {"parameters/*", "verdict", "weak", "poorly_determined"},
    {"parameters/*", "verdict", "flat", "not_identifiable"},
    {"objective", "evaluation_method", "direct", "time_varying_filter"},
    {"objective", "evaluation_method", "steady", "steady_state_filter"},
    {"objective", "evaluation_method", "compressed", "sample_autocovariances"},
    {"derived/*", "name", "predicted loss in tr P", "excess mean-square error"},
    {"survey/identifiable/*", "answer", "weak", "poorly"},
    {"warnings/*", "code", "path", "evaluation_method"},
    {"warnings/*", "code", "blind", "insufficient_power"},
    {"warnings/*", "code", "noise_place", "noise_source"},
};

template <typename Change>
void for_each_object(Json& from, std::string_view place, const Change& change) {
  if (place.empty()) {
    if (from.is_object()) change(from);
    return;
  }
  const std::size_t end = place.find('/');
  const std::string_view step = place.substr(0, end);
  const std::string_view rest = end == place.npos ? std::string_view() : place.substr(end + 1);
  if (step == "*") {
    if (!from.is_array()) return;
    for (Json& item : from) for_each_object(item, rest, change);
    return;
  }
  if (!from.is_object()) return;
  if (const auto at = from.find(step); at != from.end()) for_each_object(*at, rest, change);
}

template <std::size_t n>
void rename_keys(Json& file, const RenamedKey (&keys)[n]) {
  for (const RenamedKey& key : keys) {
    for_each_object(file, key.place, [&](Json& object) {
      const auto at = object.find(key.before);
      if (at == object.end()) return;
      Json value = std::move(*at);
      object.erase(at);
      object[std::string(key.now)] = std::move(value);
    });
  }
}

// What a schema says itself, or a definition that it refers to, perhaps as one of two.
Json& referred_to(Json& schema, Json& root) {
  if (schema.contains("anyOf")) return referred_to(schema["anyOf"][0], root);
  if (!schema.contains("$ref")) return schema;
  const std::string to = schema["$ref"];
  return root["$defs"][to.substr(to.rfind('/') + 1)];
}

Json& schema_at(Json& root, std::string_view place) {
  Json* at = &root;
  while (!place.empty()) {
    const std::size_t end = std::min(place.find('/'), place.size());
    const std::string step(place.substr(0, end));
    at = &referred_to(step == "*" ? at->at("items") : at->at("properties").at(step), root);
    place.remove_prefix(std::min(end + 1, place.size()));
  }
  return *at;
}

}  // namespace

void add_old_keys_to_schema(Json& schema) {
  for (const RenamedKey& key : kRenamedKeys) {
    Json& properties = schema_at(schema, key.place).at("properties");
    if (!properties.contains(key.now)) {
      throw std::logic_error("no key " + std::string(key.now) + " in the schema");
    }
    properties[std::string(key.before)] = {{"deprecated", true}};
  }
}

void add_old_keys(Json& result) {
  for (auto key = std::rbegin(kRenamedKeys); key != std::rend(kRenamedKeys); ++key) {
    for_each_object(result, key->place, [&](Json& object) {
      const auto at = object.find(key->now);
      if (at == object.end()) return;
      Json value = *at;
      object[std::string(key->before)] = std::move(value);
    });
  }
}

void add_new_keys(Json& result) {
  const auto add = [&](std::string_view place, const char* key, const Json& value) {
    for_each_object(result, place, [&](Json& object) {
      if (!object.contains(key)) object[key] = value;
    });
  };
  add("", "handling", nullptr);
  add("", "forecast", nullptr);
  add("", "curves", Json::array());
  add("", "black_box", nullptr);
  for (const char* key : {"polynomials", "step_responses", "frequency_responses"})
    add("black_box", key, Json::array());
  for (const char* key : {"frequency_se", "damping_se", "time_constant_se"})
    add("black_box/poles/*", key, nullptr);
  add("black_box/impulse_responses/*", "kernel", "TC");
  add("black_box/candidates/*", "control_fit", nullptr);
  add("black_box/delays/*", "before", nullptr);
  add("black_box", "horizon", 0);
  add("black_box", "nonlinearities", Json::array());
  add("black_box", "transfer_functions", Json::array());
  add("objective", "diffuse_samples", 0);
  add("objective", "leading", Json::array());
  add("objective", "bic_values", nullptr);
  add("objective", "rows", 0);
  add("objective", "integration_step", nullptr);
  add("tests/*", "share", nullptr);
  add("parameters/*", "se_structure", nullptr);
  add("", "driven", Json::array());
  add("", "references", Json::array());
  add("parameters/*", "prior", "");
  add("warnings/*", "changes", Json::array());
  add("survey/findings/*", "changes", Json::array());
}

void upgrade_result(Json& result) {
  rename_keys(result, kRenamedKeys);
  add_new_keys(result);
  for (const RenamedValue& value : kRenamedValues) {
    for_each_object(result, value.place, [&](Json& object) {
      const auto at = object.find(value.key);
      if (at != object.end() && *at == value.before) *at = value.now;
    });
  }
  add_old_keys(result);
  result["schema_version"] = kSchemaVersion;
}

void upgrade_page_data(Json& data) {
  rename_keys(data, kRenamedPageKeys);
  data["schema_version"] = kSchemaVersion;
}

}  // namespace identikal
