#include "fleet/manifest.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <optional>
#include <unordered_set>
#include <utility>

#include "fleet/simulated.h"
#include <fmt/format.h>
#include <glob.h>

#include "lib/base/error.h"
#include "lib/base/nearest_name.h"
#include "lib/data/csv.h"
#include "lib/data/join.h"
#include "lib/data/text_table.h"

namespace identikal {
namespace {

namespace fs = std::filesystem;

const std::vector<std::string> kColumns = {"recording", "unit", "group", "options", "where"};

std::vector<FleetJob> of_folder(const std::string& folder) {
  std::vector<std::string> files;
  std::error_code error;
  for (fs::recursive_directory_iterator at(folder, error), end; !error && at != end;
       at.increment(error)) {
    if (at->path().extension() == ".csv" && !at->is_directory()) files.push_back(at->path());
  }
  if (error) throw InputError({folder}, "cannot read the folder: " + error.message());
  if (files.empty()) throw InputError({folder}, "no file *.csv in this folder", "recordings");
  std::sort(files.begin(), files.end());
  std::vector<FleetJob> out;
  for (std::string& file : files) out.push_back({std::move(file), {}, {}, {}, {}, {}});
  return out;
}

std::vector<FleetJob> of_pattern(const std::string& pattern) {
  glob_t found{};
  const int code = glob(pattern.c_str(), GLOB_MARK, nullptr, &found);
  std::vector<FleetJob> out;
  for (std::size_t i = 0; code == 0 && i < found.gl_pathc; ++i) {
    std::string path = found.gl_pathv[i];
    if (!path.ends_with('/')) out.push_back({std::move(path), {}, {}, {}, {}, {}});
  }
  globfree(&found);
  if (out.empty()) {
    throw InputError({}, fmt::format("no file matches '{}'", pattern), "recordings",
                     "quote the pattern, and write it relative to the current folder");
  }
  std::sort(out.begin(), out.end(),
            [](const FleetJob& a, const FleetJob& b) { return a.recording < b.recording; });
  return out;
}

bool is_column(const std::string& name) {
  return std::find(kColumns.begin(), kColumns.end(), name) != kColumns.end();
}

// Other columns are covariates, unless they are meant as one of these.
void check_columns(const TextTable& table) {
  for (const std::string& name : table.header) {
    const std::string meant = is_column(name) ? "" : did_you_mean(name, kColumns);
    if (name.empty() || !meant.empty()) {
      throw InputError({table.path, 1}, fmt::format("a manifest with a column '{}'", name),
                       "recording, unit, group, options, where, and names of covariates", meant);
    }
  }
}

// Relative to the manifest's folder, each of files that are joined.
std::string recording_of(const std::string& written, const fs::path& folder) {
  if (folder.empty() || is_simulation(written)) return written;
  std::string out;
  for (const std::string& file : joined_files(written)) {
    const fs::path path(file);
    out += (out.empty() ? "" : "+") + (path.is_absolute() ? path : folder / path).string();
  }
  return out;
}

std::vector<FleetJob> of_table(const TextTable& table) {
  check_columns(table);
  const fs::path folder = fs::path(table.path).parent_path();
  std::vector<FleetJob> out;
  for (const TextTable::Row& row : table.rows) {
    const auto cell = [&](const char* name) {
      const std::size_t at = table.position(name);
      return at < row.cells.size() ? row.cells[at] : std::string();
    };
    const std::string recording = cell("recording");
    if (recording.empty()) {
      throw InputError({table.path, row.line}, "no recording", "a path in column 'recording'");
    }
    out.push_back({recording_of(recording, folder), cell("unit"), cell("group"), cell("options"),
                   cell("where")});
    for (std::size_t i = 0; i < table.header.size(); ++i) {
      if (is_column(table.header[i]) || row.cells[i].empty()) continue;
      out.back().covariates.emplace_back(table.header[i], row.cells[i]);
    }
  }
  if (out.empty()) throw InputError({table.path}, "a manifest without rows", "recordings");
  return out;
}

// Nothing where the file is a recording.
std::optional<std::vector<FleetJob>> of_manifest(const std::string& path) {
  std::ifstream file(path);
  std::string line;
  while (std::getline(file, line) && (line.empty() || line.starts_with('#'))) {
  }
  if (line.find("recording") == std::string::npos) return std::nullopt;
  const TextTable table = parse_text_table(read_csv_text(path), path);
  if (table.position("recording") == table.header.size()) return std::nullopt;
  return of_table(table);
}

std::vector<FleetJob> jobs_of(const std::string& manifest) {
  if (is_simulation(manifest)) return simulations_of(manifest);
  std::error_code ignored;
  if (fs::is_directory(manifest, ignored)) return of_folder(manifest);
  const bool there = fs::exists(manifest, ignored);
  if (!there && manifest.find_first_of("*?[") != std::string::npos) return of_pattern(manifest);
  if (fs::is_regular_file(manifest, ignored)) {
    if (auto jobs = of_manifest(manifest)) return *std::move(jobs);
  }
  return {{manifest, {}, {}, {}, {}, {}}};
}

void check_repeated(const std::vector<FleetJob>& jobs) {
  std::unordered_set<std::string> seen;
  for (const FleetJob& job : jobs) {
    const std::string key = job.recording + '\n' + job.options + '\n' + job.where;
    if (seen.insert(key).second) continue;
    throw InputError({job.recording}, "the same recording, options and rows stand twice",
                     "each once", "two units cannot have the same recording");
  }
}

}  // namespace

std::vector<FleetJob> read_manifests(const std::vector<std::string>& manifests) {
  std::vector<FleetJob> out;
  for (const std::string& manifest : manifests) {
    std::vector<FleetJob> jobs = jobs_of(manifest);
    if (out.empty()) {
      out = std::move(jobs);
    } else {
      out.insert(out.end(), jobs.begin(), jobs.end());
    }
  }
  check_repeated(out);
  return out;
}

std::vector<std::string> option_words(const std::string& options) {
  std::vector<std::string> out;
  std::string word;
  bool begun = false;
  char quote = '\0';
  for (const char c : options) {
    if (quote != '\0') {
      if (c == quote) {
        quote = '\0';
      } else {
        word += c;
      }
    } else if (c == '\'' || c == '"') {
      quote = c;
      begun = true;
    } else if (c == ' ' || c == '\t') {
      if (begun) out.push_back(std::exchange(word, {}));
      begun = false;
    } else {
      word += c;
      begun = true;
    }
  }
  if (quote != '\0') {
    throw InputError({}, fmt::format("options '{}' with a quote that is not closed", options),
                     "--name 'value'");
  }
  if (begun) out.push_back(word);
  return out;
}

}  // namespace identikal
