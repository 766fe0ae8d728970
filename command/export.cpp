// export: a result as code to paste.
#include "identify/result/export.h"

#include <ctime>
#include <memory>
#include <optional>

#include "jobs/output_files.h"
#include "jobs/run.h"
#include <fmt/format.h>
#include <sys/stat.h>

#include "command/verbs.h"
#include "lib/base/error.h"
#include "lib/base/nearest_name.h"

namespace identikal {
namespace {

struct ExportOptions {
  std::string result, format, file;
  bool force = false;
};

// UTC day on which a file was written, "2026-03-01".
std::string day_of_file(const std::string& path) {
  struct stat status {};
  std::tm utc{};
  if (stat(path.c_str(), &status) != 0 || gmtime_r(&status.st_mtime, &utc) == nullptr) return "";
  return fmt::format("{:04}-{:02}-{:02}", utc.tm_year + 1900, utc.tm_mon + 1, utc.tm_mday);
}

// What nobody should build on is not handed on by accident.
void refuse_doubtful(const StoredResult& result) {
  const Status status = result.estimate.status;
  if (status != Status::untrusted && status != Status::not_converged) return;
  throw InputError(
      {result.path, 0, 0},
      fmt::format("the result is '{}': {}", to_string(status), result.estimate.message),
      "a result to be trusted", "--force exports it all the same");
}

Outcome export_result(const ExportOptions& options) {
  const std::optional<ExportFormat> format = export_format(options.format);
  if (!format) {
    throw InputError({}, fmt::format("--to '{}'", options.format), export_format_list(),
                     did_you_mean(options.format, export_formats()));
  }
  const StoredResult result = read_stored_result(options.result, PageData::if_there);
  if (!options.force) refuse_doubtful(result);
  const std::string text = export_text(result, *format, day_of_file(result.path));
  Outcome out;
  out.text = text;
  if (!options.file.empty()) {
    write_files({{options.file, text}}, files_of(result, options.result));
    out.text = fmt::format("{} written\n", options.file);
  }
  return out;
}

}  // namespace

Verb export_verb() {
  const auto options = std::make_shared<ExportOptions>();
  Verb verb{"export", "Print a result that -o has written as code to paste."};
  add_argument(verb, "RESULT", options->result, "Result: result.json, or its folder.");
  add_required_text(verb, "--to", options->format,
                    "Choose the format: " + export_format_list() + ".");
  add_file(verb, "-o,--output", options->file, "Write the text to this file instead.");
  add_flag(verb, "--force", options->force, "Export a result that is not to be trusted, too.");
  verb.run = [options](Call&) { return export_result(*options); };
  return verb;
}

}  // namespace identikal
