#include "identify/result/file.h"

#include <cmath>
#include <filesystem>
#include <system_error>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "identify/result/file_digest.h"
#include "identify/result/internal/json_reader.h"
#include "identify/result/internal/version_1.h"
#include "identify/result/internal/whole_file.h"
#include "identify/result/schema.h"
#include "lib/base/constants.h"
#include "lib/base/error.h"

namespace identikal {
namespace {

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

// A program of the same schema may have written less than this one reads.
void bring_up_to_date(StoredJson& result) {
  result["schema_version"] == 1 ? upgrade_result(result) : add_new_keys(result);
}

// Without columns a matrix is stored without rows too.
void give_shapes(StateSpace& m) {
  if (m.B.size() == 0) m.B.resize(m.A.rows(), 0);
  if (m.D.size() == 0) m.D.resize(m.C.rows(), 0);
  if (m.G.size() == 0) m.G.resize(m.A.rows(), 0);
  if (m.S.size() == 0) m.S.resize(0, m.C.rows());
}

// Takes all that the file holds, and gives back what JSON has no number or shape for.
void read_estimate(const JsonField& root, WholeFile& file, StoredEstimate& e) {
  JsonReader reader(root);
  describe(reader, file);
  if (e.correlation.rows() != static_cast<Eigen::Index>(e.correlation_names.size())) {
    root["correlation"].refuse("has other names than rows");
  }
  if (e.filter) give_shapes(e.filter->model);
  if (e.tyre_curve.empty()) return;
  for (EstimatedParameter& p : e.parameters) {
    const bool straight = p.verdict == Verdict::at_bound && std::isnan(p.value);
    if (straight) p.value = kInfinity;
  }
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
  const StoredJson as_written = file;
  bring_up_to_date(file);
  return file == as_written ? text : printed(file);
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
    const JsonField fields(data, "", result.data_path);
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
  bring_up_to_date(file);
  WholeFile held = file_to_read(result.estimate);
  read_estimate(JsonField(file, "", result.path), held, result.estimate);
  result.version = held.version;
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
