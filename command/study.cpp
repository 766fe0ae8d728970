// study: a published table or figure, computed again.
#include "studies/study.h"

#include <memory>

#include <fmt/format.h>

#include "command/output_files.h"
#include "command/run.h"
#include "command/verbs.h"

namespace identikal {
namespace {

struct StudyRequest {
  std::string name, folder;
  long runs = 0, threads = 0;
  std::int64_t seed = 1;
  bool quiet = false;
};

int run_study(const StudyRequest& request) {
  Progress progress(request.quiet);
  StudyOptions options;
  options.runs = static_cast<int>(request.runs);
  options.seed = static_cast<std::uint64_t>(request.seed);
  options.threads = static_cast<int>(request.threads);
  options.progress = [&](int done, int of) {
    progress.show(fmt::format("{}: run {} of {}", request.name, done, of));
  };
  const StudyReport report = study(request.name, options);
  progress.clear();
  if (!request.folder.empty()) {
    std::vector<ResultFile> files{{request.name + ".txt", report.text}};
    if (report.figure) {
      files.push_back({request.name + ".csv", report.csv});
      files.push_back({request.name + ".svg", svg(*report.figure)});
    }
    write_files(in_folder(request.folder, files));
  }
  print(report.text);
  return 0;
}

}  // namespace

Verb study_verb(CLI::App& app) {
  const auto request = std::make_shared<StudyRequest>();
  CLI::App& verb = add_verb(app, "study",
                            "Compute a published table or figure again, alongside the published "
                            "numbers.");
  add_argument(verb, "NAME", request->name, "Name of the study: " + study_ranges() + ".");
  add_folder(verb, "-o,--output", request->folder,
             "Write NAME.txt to this folder, and of a figure NAME.svg and its numbers, NAME.csv.");
  add_number(verb, "--runs", request->runs, 2, 100000,
             "Number of repetitions of each line. Without it, as many as were published.");
  add_seed(verb, request->seed, "Seed of the simulated recordings.");
  add_number(verb, "--threads", request->threads, 1, 1024,
             "Number of threads that share the repetitions. Without it, one for each core.");
  add_quiet(verb, request->quiet);
  return {"study", [request](const std::string&) { return run_study(*request); }};
}

}  // namespace identikal
