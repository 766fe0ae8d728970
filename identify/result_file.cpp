#include "identify/result_file.h"

#include <array>
#include <filesystem>
#include <fstream>
#include <initializer_list>
#include <limits>
#include <sstream>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "lib/error.h"

namespace identikal {
namespace {

using StoredJson = nlohmann::ordered_json;

constexpr int kReadableSchema = 1;

StoredJson parsed_result(const std::string& path, const std::string& text) {
  StoredJson out;
  try {
    out = StoredJson::parse(text);
  } catch (const StoredJson::parse_error& error) {
    throw InputError({path, 0, 0},
                     fmt::format("no whole JSON text: it breaks at byte {}", error.byte),
                     "a file as -o writes it", "run the job again with -o");
  }
  if (!out.is_object() || !out.contains("schema_version")) {
    throw InputError({path, 0, 0}, "no result of this program", "a result.json as -o writes it");
  }
  if (out["schema_version"] != kReadableSchema) {
    throw InputError({path, 0, 0}, fmt::format("schema_version {}", out["schema_version"].dump()),
                     fmt::format("{}", kReadableSchema),
                     "run the job again with -o, or use the version that wrote it");
  }
  return out;
}

// A value of the file with the way to it, for messages.
class Field {
 public:
  Field(const StoredJson& value, std::string name, const std::string& path)
      : value_(value), name_(std::move(name)), path_(path) {}

  [[noreturn]] void refuse(const std::string& found) const {
    throw InputError({path_, 0, 0}, fmt::format("'{}' {}", name_, found),
                     "a result.json as -o writes it", "run the job again with -o");
  }
  Field operator[](const char* key) const {
    const std::string name = name_.empty() ? key : name_ + "." + key;
    if (!value_.is_object()) refuse("is no object");
    const auto at = value_.find(key);
    if (at == value_.end()) Field(value_, name, path_).refuse("is missing");
    return {*at, name, path_};
  }
  std::vector<Field> items() const {
    if (!value_.is_array()) refuse("is no list");
    std::vector<Field> out;
    for (const StoredJson& item : value_) {
      out.emplace_back(item, fmt::format("{}[{}]", name_, out.size()), path_);
    }
    return out;
  }
  std::vector<std::pair<std::string, Field>> members() const {
    if (!value_.is_object()) refuse("is no object");
    std::vector<std::pair<std::string, Field>> out;
    for (const auto& [key, item] : value_.items()) {
      out.emplace_back(key, Field(item, name_ + "." + key, path_));
    }
    return out;
  }
  std::string text() const {
    if (!value_.is_string()) refuse("is no text");
    return value_.get<std::string>();
  }
  double number() const {
    if (value_.is_null()) return kNone;
    if (!value_.is_number()) refuse("is no number");
    return value_.get<double>();
  }
  bool yes() const {
    if (!value_.is_boolean()) refuse("is neither true nor false");
    return value_.get<bool>();
  }
  // null: there is none.
  std::array<double, 2> bounds() const {
    const std::vector<Field> ends = items();
    if (ends.size() != 2) refuse("is no interval");
    constexpr double kFar = std::numeric_limits<double>::infinity();
    const double low = ends[0].number(), high = ends[1].number();
    return {low == low ? low : -kFar, high == high ? high : kFar};
  }
  template <typename Enum>
  Enum word(std::initializer_list<Enum> known) const {
    const std::string found = text();
    for (const Enum each : known) {
      if (to_string(each) == found) return each;
    }
    refuse("is '" + found + "'");
  }

 private:
  const StoredJson& value_;
  std::string name_;
  const std::string& path_;
};

std::vector<ChannelFit> fits_of(const Field& field) {
  std::vector<ChannelFit> out;
  for (const auto& [channel, fit] : field.members()) {
    out.push_back({channel, fit["unit"].text(), fit["fit_percent"].number(), fit["rmse"].number()});
  }
  return out;
}

Estimate estimate_of(const Field& root) {
  Estimate out;
  out.verb = root["verb"].text();
  out.model_name = root["model"].text();
  out.status = root["status"]["code"].word(
      {Status::ok, Status::answer_no, Status::not_converged, Status::untrusted});
  out.message = root["status"]["message"].text();
  for (const Field& input : root["inputs"].items()) {
    out.inputs.push_back({input["path"].text(), input["sha256"].text(),
                          static_cast<long>(input["rows"].number()),
                          static_cast<long>(input["used"].number())});
  }
  for (const Field& field : root["parameters"].items()) {
    EstimatedParameter p;
    p.name = field["name"].text();
    p.unit = field["unit"].text();
    p.value = field["value"].number();
    p.bounds = field["bounds"].bounds();
    p.fixed = field["fixed"].yes();
    p.verdict =
        field["verdict"].word({Verdict::ok, Verdict::weak, Verdict::correlated, Verdict::at_bound,
                               Verdict::unexcited, Verdict::flat, Verdict::unfitted});
    out.parameters.push_back(std::move(p));
  }
  const Field objective = root["objective"];
  out.objective.method = objective["method"].text();
  out.objective.initial = objective["initial"].text();
  out.objective.log_likelihood = objective["log_likelihood"].number();
  out.objective.aic = objective["aic"].number();
  out.objective.bic = objective["bic"].number();
  const Field fit = root["fit"];
  out.one_step = fits_of(fit["one_step"]);
  out.simulation = fits_of(fit["simulation"]);
  out.hold_out = fits_of(fit["hold_out"]);
  return out;
}

}  // namespace

StoredResult read_stored_result(const std::string& path) {
  namespace fs = std::filesystem;
  StoredResult out;
  out.path = fs::is_directory(path) ? (fs::path(path) / "result.json").string() : path;
  std::ifstream file(out.path, std::ios::binary);
  std::ostringstream text;
  if (!file || !(text << file.rdbuf())) {
    throw InputError({out.path, 0, 0}, "cannot be read", "a file as -o writes it",
                     "name the folder that -o was given");
  }
  out.text = std::move(text).str();
  const StoredJson json = parsed_result(out.path, out.text);
  out.estimate = estimate_of(Field(json, "", out.path));
  return out;
}

}  // namespace identikal
