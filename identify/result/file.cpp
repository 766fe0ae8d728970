#include "identify/result/file.h"

#include <array>
#include <cmath>
#include <filesystem>
#include <initializer_list>
#include <system_error>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "identify/result/file_digest.h"
#include "identify/result/internal/version_1.h"
#include "identify/result/schema.h"
#include "lib/base/constants.h"
#include "lib/base/error.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using StoredJson = nlohmann::ordered_json;

// Results and what their pages draw are nowhere near as deep; printing is recursive.
constexpr int kDeepest = 64;

StoredJson parsed_json(const std::string& path, const std::string& text) {
  const auto refuse = [&](const std::string& what) {
    throw InputError({path, 0, 0}, what, "a file as -o writes it", "run the job again with -o");
  };
  const auto depth_allowed = [&](int depth, StoredJson::parse_event_t, StoredJson&) {
    if (depth > kDeepest) refuse(fmt::format("lists or objects in more than {} others", kDeepest));
    return true;
  };
  try {
    return StoredJson::parse(text, depth_allowed);
  } catch (const StoredJson::parse_error& error) {
    refuse(fmt::format("no whole JSON text: it breaks at byte {}", error.byte));
  } catch (const StoredJson::out_of_range&) {
    refuse("a number is too large");
  }
  return {};
}

// In quotes where it is a text; on one line.
std::string shown(const StoredJson& value) {
  constexpr std::size_t kLongest = 40;
  const std::string text = value.dump(-1, ' ', true, StoredJson::error_handler_t::replace);
  return text.size() <= kLongest ? text : text.substr(0, kLongest) + "...";
}

void check_version(const std::string& path, const StoredJson& file) {
  if (!file.is_object() || !file.contains("schema_version")) {
    throw InputError({path, 0, 0}, "no result of this program", "a result.json as -o writes it");
  }
  const StoredJson& version = file["schema_version"];
  if (version != 1 && version != kSchemaVersion) {
    throw InputError({path, 0, 0}, "schema_version " + shown(version),
                     fmt::format("1 or {}", kSchemaVersion),
                     "run the job again with -o, or use the version that wrote it");
  }
}

std::string printed(const StoredJson& file) {
  return file.dump(-1, ' ', false, StoredJson::error_handler_t::replace);
}

std::string fingerprint_without(StoredJson file, const char* key) {
  file[key] = nullptr;
  return sha256_of_text(printed(file));
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
  bool absent() const { return value_.is_null(); }
  std::string text() const {
    if (!value_.is_string()) refuse("is no text");
    return value_.get<std::string>();
  }
  double number() const {
    if (absent()) return kNone;
    if (!value_.is_number()) refuse("is no number");
    return value_.get<double>();
  }
  long count() const {
    if (!value_.is_number_integer()) refuse("is no whole number");
    return value_.get<long>();
  }
  bool yes() const {
    if (!value_.is_boolean()) refuse("is neither true nor false");
    return value_.get<bool>();
  }
  std::array<double, 2> interval() const {
    const std::vector<Field> ends = items();
    if (ends.size() != 2) refuse("is no interval");
    return {ends[0].number(), ends[1].number()};
  }
  // null: there is none.
  std::array<double, 2> bounds() const {
    const auto [low, high] = interval();
    return {std::isnan(low) ? -kInfinity : low, std::isnan(high) ? kInfinity : high};
  }
  std::vector<std::string> names() const {
    std::vector<std::string> out;
    for (const Field& item : items()) out.push_back(item.text());
    return out;
  }
  MatrixXd matrix() const {
    if (absent()) return {};
    const std::vector<Field> rows = items();
    MatrixXd out;
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const std::vector<Field> row = rows[i].items();
      if (i == 0) out.resize(static_cast<Index>(rows.size()), static_cast<Index>(row.size()));
      if (static_cast<Index>(row.size()) != out.cols()) refuse("has rows of different lengths");
      for (std::size_t j = 0; j < row.size(); ++j) {
        out(static_cast<Index>(i), static_cast<Index>(j)) = row[j].number();
      }
    }
    return out;
  }
  template <typename Enum>
  Enum word(std::initializer_list<Enum> known) const {
    const std::string found = text();
    for (const Enum each : known) {
      if (to_string(each) == found) return each;
    }
    refuse("is " + shown(value_));
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

EstimatedParameter parameter_of(const Field& field) {
  EstimatedParameter p;
  p.name = field["name"].text();
  p.unit = field["unit"].text();
  p.value = field["value"].number();
  p.se = field["se"].number();
  p.ci95 = field["ci95"].interval();
  p.profile95 = field["profile95"].interval();
  p.se_sandwich = field["se_sandwich"].number();
  p.crb_se = field["crb_se"].number();
  p.start = field["start"].number();
  p.bounds = field["bounds"].bounds();
  p.fixed = field["fixed"].yes();
  p.verdict = field["verdict"].word({Verdict::ok, Verdict::poorly_determined, Verdict::correlated,
                                     Verdict::at_bound, Verdict::unexcited,
                                     Verdict::not_identifiable, Verdict::unfitted});
  p.with = field["with"].names();
  return p;
}

SteadyFilter filter_of(const Field& field) {
  SteadyFilter f;
  StateSpace& m = f.model;
  m.dt = field["dt"].number();
  for (const auto& [key, M] :
       {std::pair{"A", &m.A}, std::pair{"B", &m.B}, std::pair{"C", &m.C}, std::pair{"D", &m.D},
        std::pair{"G", &m.G}, std::pair{"Q", &m.Q}, std::pair{"R", &m.R}, std::pair{"S", &m.S},
        std::pair{"K", &f.K}, std::pair{"L", &f.L}, std::pair{"P", &f.P},
        std::pair{"Sigma", &f.Sigma}}) {
    *M = field[key].matrix();
  }
  // Without columns a matrix is stored without rows too.
  if (m.B.size() == 0) m.B.resize(m.A.rows(), 0);
  if (m.D.size() == 0) m.D.resize(m.C.rows(), 0);
  if (m.G.size() == 0) m.G.resize(m.A.rows(), 0);
  if (m.S.size() == 0) m.S.resize(0, m.C.rows());
  for (const auto& [key, channels] :
       {std::pair{"inputs", &f.inputs}, std::pair{"outputs", &f.outputs},
        std::pair{"states", &f.states}}) {
    for (const Field& c : field[key].items()) {
      channels->push_back({c["name"].text(), c["unit"].text()});
    }
  }
  return f;
}

StoredEstimate estimate_of(const Field& root) {
  StoredEstimate out;
  out.verb = root["verb"].text();
  out.model_name = root["model"].text();
  out.status = root["status"]["code"].word(
      {Status::ok, Status::rejected, Status::not_converged, Status::untrusted});
  out.message = root["status"]["message"].text();
  for (const Field& input : root["inputs"].items()) {
    out.inputs.push_back({input["path"].text(), input["sha256"].text(), input["rows"].count(),
                          input["used"].count(), input["range"].bounds()});
  }
  if (const Field model = root["model_file"]; !model.absent()) {
    out.model_file = {model["path"].text(), model["sha256"].text(), model["text"].text(), {}};
    for (const Field& file : model["included"].items()) {
      out.model_file->included.push_back({file["path"].text(), file["sha256"].text()});
    }
  }
  for (const Field& p : root["parameters"].items()) out.parameters.push_back(parameter_of(p));
  out.covariance_kind = root["covariance_kind"].text();
  out.covariance_freedom = root["covariance_freedom"].number();
  out.correlation_names = root["correlation"]["names"].names();
  out.correlation = root["correlation"]["matrix"].matrix();
  if (out.correlation.rows() != static_cast<Index>(out.correlation_names.size())) {
    root["correlation"].refuse("has other names than rows");
  }
  const Field noise = root["noise"];
  out.noise.Q = noise["Q"]["matrix"].matrix();
  out.noise.Q_kind = noise["Q"]["kind"].text();
  out.noise.R = noise["R"]["matrix"].matrix();
  out.noise.S = noise["S"].matrix();
  out.noise.K_steady = noise["K_steady"].matrix();
  out.noise.P_steady = noise["P_steady"].matrix();
  if (const Field filter = root["filter"]; !filter.absent()) out.filter = filter_of(filter);
  if (const Field curve = root["tyre_curve"]; !curve.absent()) out.tyre_curve = curve.text();
  if (!out.tyre_curve.empty()) {
    for (EstimatedParameter& p : out.parameters) {
      const bool straight = p.verdict == Verdict::at_bound && std::isnan(p.value);
      if (straight) p.value = kInfinity;
    }
  }
  const Field objective = root["objective"];
  out.objective.method = objective["method"].text();
  out.objective.initial = objective["initial"].text();
  out.objective.filter = objective["filter"].text();
  out.objective.log_likelihood = objective["log_likelihood"].number();
  out.objective.aic = objective["aic"].number();
  out.objective.bic = objective["bic"].number();
  out.objective.samples = objective["samples"].count();
  out.objective.held_out = objective["held_out"].number();
  const Field fit = root["fit"];
  out.one_step = fits_of(fit["one_step"]);
  out.simulation = fits_of(fit["simulation"]);
  out.hold_out = fits_of(fit["hold_out"]);
  out.hold_out_one_step = fits_of(fit["hold_out_one_step"]);
  for (const Field& test : root["tests"].items()) {
    out.tests.push_back({test["id"].text(), test["channel"].text(), test["value"].number(),
                         test["interval"].interval(), test["p"].number(), test["pass"].yes(),
                         test["level"].number()});
  }
  for (const Field& d : root["derived"].items()) {
    out.derived.push_back(
        {d["name"].text(), d["unit"].text(), d["value"].number(), d["se"].number()});
  }
  for (const Field& w : root["warnings"].items()) {
    Finding finding;
    set_code(finding, w["code"].text());
    finding.severity = w["severity"].word({Severity::note, Severity::warning, Severity::serious});
    finding.about = w["about"].names();
    finding.text = w["text"].text();
    finding.remedy = w["remedy"].text();
    out.findings.push_back(std::move(finding));
  }
  out.notes = root["notes"].names();
  return out;
}

}  // namespace

std::string result_fingerprint(const std::string& text) {
  return fingerprint_without(StoredJson::parse(text), "timing_s");
}

std::string report_data_fingerprint(const std::string& text) {
  return fingerprint_without(StoredJson::parse(text), "sha256");
}

std::string result_in_this_version(const std::string& text) {
  StoredJson file = StoredJson::parse(text);
  if (file["schema_version"] != 1) return text;
  upgrade_result(file);
  return printed(file);
}

std::string page_data_in_this_version(const std::string& text) {
  StoredJson file = StoredJson::parse(text);
  if (file["schema_version"] != 1) return text;
  upgrade_page_data(file);
  return printed(file);
}

StoredResult parse_stored_result(StoredResult result) {
  StoredJson file = parsed_json(result.path, result.text);
  check_version(result.path, file);
  if (!result.data.empty()) {
    const StoredJson data = parsed_json(result.data_path, result.data);
    check_version(result.data_path, data);
    const Field fields(data, "", result.data_path);
    if (fields["result_sha256"].text() != fingerprint_without(file, "timing_s")) {
      throw InputError({result.data_path, 0, 0}, "belongs to another result",
                       "both files from one run", "run the job again with -o");
    }
    if (fields["sha256"].text() != fingerprint_without(data, "sha256")) {
      throw InputError({result.data_path, 0, 0}, "has been changed since it was written",
                       "the file as -o wrote it", "run the job again with -o");
    }
    result.command = fields["provenance"]["command"].text();
  }
  if (file["schema_version"] == 1) upgrade_result(file);
  const Field root(file, "", result.path);
  result.version = root["version"].text();
  result.estimate = estimate_of(root);
  return result;
}

StoredResult read_stored_result(const std::string& path, PageData data) {
  namespace fs = std::filesystem;
  std::error_code ignored;
  const fs::path result_path =
      fs::is_directory(path, ignored) ? fs::path(path) / "result.json" : fs::path(path);
  const fs::path data_path = result_path.parent_path() / kReportDataFile;
  StoredResult out;
  out.path = result_path.string();
  out.data_path = data_path.string();
  const std::string expected = "a file as -o writes it";
  out.text = text_of_file(out.path, expected, "name the folder that -o was given");
  if (data == PageData::required ||
      (data == PageData::if_there && fs::exists(data_path, ignored))) {
    // What is wrong with the result is said first.
    check_version(out.path, parsed_json(out.path, out.text));
    out.data = text_of_file(out.data_path, expected,
                            "tune, check, fit, shape and track write it beside result.json");
    if (out.data.empty()) throw InputError({out.data_path, 0, 0}, "is empty", expected);
  }
  return parse_stored_result(std::move(out));
}

}  // namespace identikal
