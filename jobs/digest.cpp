// digest: what the likelihood needs of recordings, in a small file.
#include <algorithm>
#include <filesystem>
#include <memory>

#include "jobs/digest_inputs.h"
#include "jobs/output_files.h"
#include "jobs/run.h"
#include "jobs/verbs.h"
#include <fmt/format.h>

#include "identify/result/file_digest.h"
#include "lib/base/error.h"

namespace identikal {
namespace {

struct DigestOptions {
  ModelOptions model;
  RecordingOptions recordings;
  std::string file;
  std::int64_t lags = 64;
};

// A folder stands for the digests in it.
std::vector<std::string> files_named(const std::vector<std::string>& arguments) {
  std::vector<std::string> out;
  for (const std::string& argument : arguments) {
    std::error_code ignored;
    if (!std::filesystem::is_directory(argument, ignored)) {
      out.push_back(argument);
      continue;
    }
    std::vector<std::string> found;
    for (const auto& entry : std::filesystem::directory_iterator(argument)) {
      if (is_digest_name(entry.path().string())) found.push_back(entry.path().string());
    }
    if (found.empty()) throw InputError({argument}, "no file *.digest in this folder", "digests");
    std::sort(found.begin(), found.end());
    out.insert(out.end(), found.begin(), found.end());
  }
  return out;
}

// Of recordings, each of them gapless; of a file with several runs each has its own.
DigestFile digests_of(const DigestOptions& options, const Call& call, Inputs& inputs) {
  Model model = load_model(options.model, "digest", inputs);
  require_linear(model, "digest");
  const Recordings recordings = load_recordings(options.recordings, model, "digest", inputs);
  take_period(model, recordings.data.front());
  DigestFile out = digest_file_of(model, noise_model(model).dt);
  for (std::size_t file = 0; file < recordings.records.size(); ++file) {
    const auto [from, to] = recordings.of_records[file];
    for (std::size_t i = from; i < to; ++i) {
      report_progress(call, "digest of " + recordings.data[i].name);
      const std::string name = fmt::format("{} {} {}", recordings.records[file].sha256,
                                           options.recordings.range, i - from);
      out.digests.push_back(
          {sha256_of_text(name), digest_of(model, recordings.data[i], options.lags)});
    }
  }
  return out;
}

Outcome digest(DigestOptions& options, Call& call) {
  options.recordings.files = files_named(options.recordings.files);
  const bool merging = are_digests(options.recordings.files);
  if (merging && !options.recordings.range.empty()) {
    throw InputError({}, "--range with digests", "recordings", "digests have no rows any more");
  }
  const DigestFile file =
      merging ? read_digests(options.recordings.files) : digests_of(options, call, call.inputs);
  const std::string text = digest_text(file);
  write_files({{options.file, text}}, options.recordings.files);
  Eigen::Index samples = 0, lags = 0;
  for (const NamedDigest& each : file.digests) {
    samples += each.digest.samples;
    lags = std::max(lags, each.digest.lags());
  }
  Outcome out;
  out.text = fmt::format("{}: {} rows of {} recordings in {} bytes, {} lags\n", options.file,
                         samples, file.digests.size(), text.size(), lags);
  return out;
}

}  // namespace

bool are_digests(const std::vector<std::string>& files) {
  const auto count = std::count_if(files.begin(), files.end(), is_digest_name);
  if (count == 0) return false;
  if (count == static_cast<std::ptrdiff_t>(files.size())) return true;
  const auto other = std::find_if_not(files.begin(), files.end(), is_digest_name);
  throw InputError({*other}, "a recording beside digests", "digests alone, or recordings alone",
                   "'identikal digest' makes a digest of it");
}

DigestFile read_digests(const std::vector<std::string>& files) {
  std::vector<DigestFile> read;
  for (const std::string& path : files) read.push_back(read_digest_text(read_csv_text(path), path));
  return merged(std::move(read), files);
}

LoadedDigests load_digests(const std::vector<std::string>& files, Model& model, Inputs& inputs) {
  const DigestFile file = read_digests(files);
  if (model.time.step == 0.0) noise_model(model).dt = file.step;
  check_same_channels(file, digest_file_of(model, noise_model(model).dt), model.source);
  LoadedDigests out;
  Eigen::Index rows = 0;
  for (const NamedDigest& each : file.digests) {
    rows += each.digest.samples;
    out.digests.push_back(each.digest);
  }
  for (const std::string& path : files) {
    out.recordings.records.push_back({path, inputs.sha256(path), rows, rows});
    out.recordings.of_records.emplace_back(0, 1);
  }
  return out;
}

void refuse_beside_digests(const std::vector<std::pair<bool, std::string>>& given) {
  for (const auto& [is_given, name] : given) {
    if (!is_given) continue;
    throw InputError({}, fmt::format("{} does not apply to digests", name),
                     "what asks for no rows: of the recordings none are left");
  }
}

Verb digest_verb() {
  const auto options = std::make_shared<DigestOptions>();
  Verb verb{"digest",
            "Keep of long recordings what the likelihood needs, a few kilobytes each, for 'tune'; "
            "or bring digests together."};
  add_model(verb, options->model);
  add_arguments(verb, "DATA", options->recordings.files,
                "Recordings (CSV), or digests, or a folder of digests.");
  add_settings(verb, options->model);
  add_range(verb, options->recordings.range);
  add_number(verb, "--lags", options->lags, 64, 4096,
             "Keep at least so many autocovariances: filters that remember longer have no "
             "likelihood then. Without it, four times as many as the model's filter needs.",
             "64");
  Option file;
  file.names = "-o,--output";
  file.help = "Write the digest to this file, *.digest.";
  file.value = &options->file;
  file.required = true;
  file.check = [](const std::string& text) {
    if (!is_digest_name(text)) {
      throw InputError({}, fmt::format("--output '{}'", text), "a name that ends in .digest");
    }
  };
  verb.options.push_back(std::move(file));
  verb.run = [options](Call& call) { return digest(*options, call); };
  return verb;
}

}  // namespace identikal
