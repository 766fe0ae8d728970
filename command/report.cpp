// report: the page of a result that -o has written.
#include <filesystem>
#include <memory>

#include <fmt/format.h>

#include "command/output_files.h"
#include "command/run.h"
#include "command/verbs.h"
#include "identify/report/page.h"

namespace identikal {
namespace {

struct ReportOptions {
  std::string result, page;
};

int report(const ReportOptions& options) {
  const std::filesystem::path given(options.result);
  const std::string page = rebuilt_page(options.result);
  std::error_code ignored;
  const std::filesystem::path folder =
      std::filesystem::is_directory(given, ignored) ? given : given.parent_path();
  const std::string path = options.page.empty() ? (folder / "report.html").string() : options.page;
  write_files({{path, page, "--report"}},
              files_of(read_stored_result(options.result), options.result));
  print(fmt::format("{} written\n", path));
  return 0;
}

}  // namespace

Verb report_verb(CLI::App& app) {
  const auto options = std::make_shared<ReportOptions>();
  CLI::App& verb = add_verb(app, "report", "Rebuild the page of a result that -o has written.");
  add_argument(verb, "RESULT", options->result, "Result: result.json, or its folder.");
  add_file(verb, "--report", options->page,
           "Write the page to this HTML file. Without it, to report.html in the result's folder.");
  return {"report", [options](const std::string&) { return report(*options); }};
}

}  // namespace identikal
