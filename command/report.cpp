// report: the page of a result that -o has written.
#include <filesystem>
#include <memory>

#include "jobs/output_files.h"
#include "jobs/run.h"
#include <fmt/format.h>

#include "command/verbs.h"
#include "identify/report/page.h"

namespace identikal {
namespace {

struct ReportOptions {
  std::string result, page;
};

Outcome report(const ReportOptions& options) {
  const std::filesystem::path given(options.result);
  const StoredResult result = read_stored_result(options.result, PageData::required);
  std::error_code ignored;
  const std::filesystem::path folder =
      std::filesystem::is_directory(given, ignored) ? given : given.parent_path();
  const std::string path = options.page.empty() ? (folder / "report.html").string() : options.page;
  write_files({{path, report_page(result.text, result.data), "--report"}},
              files_of(result, options.result));
  Outcome out;
  out.text = fmt::format("{} written\n", path);
  return out;
}

}  // namespace

Verb report_verb() {
  const auto options = std::make_shared<ReportOptions>();
  Verb verb{"report", "Rebuild the page of a result that -o has written."};
  add_argument(verb, "RESULT", options->result, "Result: result.json, or its folder.");
  add_file(verb, "--report", options->page,
           "Write the page to this HTML file. Without it, to report.html in the result's folder.");
  verb.run = [options](Call&) { return report(*options); };
  return verb;
}

}  // namespace identikal
