// study: a published table or figure, computed again.
#include "studies/study.h"

#include <memory>

#include "jobs/output_files.h"
#include "jobs/run.h"
#include <fmt/format.h>

#include "command/verbs.h"

namespace identikal {
namespace {

struct StudyRequest {
  std::string name, folder;
  std::int64_t runs = 0, threads = 0;
  std::int64_t seed = 1;
  bool quiet = false;  // read by the command line
};

Outcome run_study(const StudyRequest& request, const Call& call) {
  StudyOptions options;
  options.runs = static_cast<int>(request.runs);
  options.seed = static_cast<std::uint64_t>(request.seed);
  options.threads = static_cast<int>(request.threads);
  options.progress = [&](int done, int of) {
    report_progress(call, fmt::format("{}: run {} of {}", request.name, done, of),
                    static_cast<double>(done) / of);
  };
  const StudyReport report = study(request.name, options);
  if (!request.folder.empty()) {
    std::vector<ResultFile> files{{request.name + ".txt", report.text}};
    if (report.figure) {
      files.push_back({request.name + ".csv", report.csv});
      files.push_back({request.name + ".svg", svg(*report.figure)});
    }
    write_files(in_folder(request.folder, files));
  }
  Outcome out;
  out.text = report.text;
  return out;
}

}  // namespace

Verb study_verb() {
  const auto request = std::make_shared<StudyRequest>();
  Verb verb{"study",
            "Compute a published table or figure again, alongside the published "
            "numbers."};
  add_argument(verb, "NAME", request->name, "Name of the study: " + study_ranges() + ".");
  add_folder(verb, "-o,--output", request->folder,
             "Write NAME.txt to this folder, and of a figure NAME.svg and its numbers, NAME.csv.");
  add_number(verb, "--runs", request->runs, 2, 100000,
             "Number of repetitions of each line. Without it, as many as were published.");
  add_seed(verb, request->seed, "Seed of the simulated recordings.");
  add_number(verb, "--threads", request->threads, 1, 1024,
             "Number of threads that share the repetitions. Without it, one for each core.");
  add_quiet(verb, request->quiet);
  verb.run = [request](Call& call) { return run_study(*request, call); };
  return verb;
}

}  // namespace identikal
