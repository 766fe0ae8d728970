#include "jobs/output_files.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <set>

#include "jobs/folder_exchange.h"
#include "jobs/unfinished_files.h"
#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include "lib/base/error.h"

namespace identikal {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void fail(const OutputFile& file, const std::string& why) {
  throw OutputError(fmt::format("{}: {}; give another place with {}", file.path, why, file.option));
}

// Where a file goes; the part is empty where it is written straight to.
struct Place {
  fs::path target, part;
};

// What has been made so far, and is taken away again when not all of it can be.
class Attempt {
 public:
  Attempt() = default;
  ~Attempt() {
    if (!done_) take_away();
    forget_unfinished();
  }
  Attempt(const Attempt&) = delete;
  Attempt& operator=(const Attempt&) = delete;

  void make_folder(const fs::path& folder, std::error_code& error) {
    std::vector<fs::path> missing;
    std::error_code unknown;
    for (fs::path each = folder; !each.empty() && !fs::exists(each, unknown);
         each = each.parent_path()) {
      missing.push_back(each);
    }
    made_.insert(made_.end(), missing.rbegin(), missing.rend());
    for (auto each = missing.rbegin(); each != missing.rend(); ++each) note_unfinished(*each);
    fs::create_directories(folder, error);
  }
  void keep() { done_ = true; }

  std::vector<Place> places;

 private:
  void take_away() {
    std::error_code ignored;
    for (const Place& place : places) {
      if (!place.part.empty()) fs::remove(place.part, ignored);
    }
    // Inner ones first; one that holds something stays.
    for (auto folder = made_.rbegin(); folder != made_.rend(); ++folder) {
      fs::remove(*folder, ignored);
    }
  }

  std::vector<fs::path> made_;  // outer ones first
  bool done_ = false;
};

Place place_of(const OutputFile& file, Attempt& attempt) {
  const fs::path given(file.path);
  const fs::path folder = given.parent_path();
  std::error_code error;
  if (!folder.empty()) {
    attempt.make_folder(folder, error);
    if (error || !fs::is_directory(folder, error)) {
      fail(file, fmt::format("cannot make the folder {}{}", folder.string(),
                             error ? ": " + error.message() : ""));
    }
  }
  Place out;
  out.target = given;
  // By hand, as the target of a link need not exist.
  for (int links = 0; fs::is_symlink(out.target, error); ++links) {
    if (links == 40) fail(file, "cannot write: links in a circle");
    out.target = out.target.parent_path() / fs::read_symlink(out.target, error);
  }
  const fs::file_status status = fs::status(out.target, error);
  if (fs::is_directory(status)) fail(file, "cannot write: it is a folder");
  if (fs::exists(status) && !fs::is_regular_file(status)) return out;
  out.part = out.target.parent_path() / unforeseeable_name();
  return out;
}

// A new file, on the disk when this returns.
bool write_part(const fs::path& path, const std::string& content) {
  note_unfinished(path);
  errno = 0;
  const int file = open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0666);
  if (file < 0) return false;
  std::size_t done = 0;
  while (done < content.size()) {
    const ssize_t more = ::write(file, content.data() + done, content.size() - done);
    if (more < 0 && errno == EINTR) continue;
    if (more <= 0) break;
    done += static_cast<std::size_t>(more);
  }
  const bool kept = done == content.size() && (fsync(file) == 0 || errno == EINVAL);
  const int why = errno;
  const bool closed = close(file) == 0;
  if (!kept) errno = why;
  return kept && closed;
}

// Names of files in it reach the disk.
void sync_folder(const fs::path& folder) {
  const int opened =
      open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (opened < 0) return;
  fsync(opened);
  close(opened);
}

bool write(const fs::path& path, const std::string& content) {
  errno = 0;
  std::ofstream out(path, std::ios::binary);
  out << content;
  out.close();
  return static_cast<bool>(out);
}

void refuse_inputs(const std::vector<OutputFile>& files, const std::vector<std::string>& inputs) {
  for (const OutputFile& file : files) {
    for (const std::string& input : inputs) {
      std::error_code neither;
      if (!fs::is_regular_file(input, neither) || !fs::equivalent(file.path, input, neither))
        continue;
      throw InputError({file.path, 0, 0}, "would be written over, and this job reads it",
                       "another place with " + file.option);
    }
  }
}

// The one that is written last would be all that is left.
void refuse_one_place_for_two(const std::vector<OutputFile>& files) {
  std::vector<fs::path> targets;
  for (const OutputFile& file : files) {
    std::error_code unknown;
    targets.push_back(fs::weakly_canonical(fs::absolute(file.path, unknown), unknown));
    const auto same = [&](const fs::path& other) {
      return !other.empty() &&
             (other == targets.back() || fs::equivalent(other, targets.back(), unknown));
    };
    const auto first = std::find_if(targets.begin(), targets.end() - 1, same);
    if (first == targets.end() - 1) continue;
    const OutputFile& other = files[static_cast<std::size_t>(first - targets.begin())];
    throw InputError(
        {other.path, 0, 0},
        other.option == file.option
            ? fmt::format("{} would be written to it twice", file.option)
            : fmt::format("{} and {} would both be written to it", other.option, file.option),
        "another place with " + other.option);
  }
}

// What an earlier run may have left in a result's folder.
const std::set<std::string>& files_of_results() {
  static const std::set<std::string> names = {
      "result.json",      "report_data.json", "residuals.csv",           "course.csv",
      "states.csv",       "innovations.csv",  "predictions.csv",         "disturbances.csv",
      "trajectories.csv", "forecast.csv",     "scenarios.csv",           "impulse.csv",
      "spectrum.csv",     "shaped.yaml",      "shaped_measurement.yaml", "extended.yaml",
      "student.yaml"};
  return names;
}

// The files of an earlier result in the folder of a new one, but those that the job has read.
std::set<std::string> stale_beside(const std::set<std::string>& names,
                                   const std::vector<std::string>& inputs) {
  std::set<std::string> stale;
  if (names.count("result.json") > 0) stale = files_of_results();
  for (const std::string& input : inputs) stale.erase(fs::path(input).filename().string());
  return stale;
}

bool holds_any(const fs::path& folder, const std::set<std::string>& names) {
  return std::any_of(names.begin(), names.end(), [&](const std::string& name) {
    std::error_code ignored;
    return fs::exists(folder / name, ignored);
  });
}

// Folders that take several files change at once, where that can be; their parts lie in the new ones.
std::vector<FolderExchange> exchanges_of(std::vector<Place>& places,
                                         const std::vector<std::string>& inputs) {
  std::map<fs::path, std::vector<Place*>> by_folder;
  for (Place& place : places) {
    if (!place.part.empty()) by_folder[place.target.parent_path()].push_back(&place);
  }
  std::vector<FolderExchange> out;
  for (const auto& [folder, files] : by_folder) {
    std::set<std::string> names;
    for (const Place* place : files) names.insert(place->target.filename().string());
    if (files.size() < 2 && !holds_any(folder, stale_beside(names, inputs))) continue;
    std::optional<FolderExchange> exchange =
        FolderExchange::beside(folder, names, stale_beside(names, inputs));
    if (!exchange) continue;
    for (Place* place : files) place->part = exchange->fresh() / place->target.filename();
    out.push_back(std::move(*exchange));
  }
  return out;
}

// Of folders that did not change at once, where they are still there.
void remove_stale(const std::vector<Place>& places, const std::set<fs::path>& changed,
                  const std::vector<std::string>& inputs) {
  std::map<fs::path, std::set<std::string>> by_folder;
  for (const Place& place : places) {
    const fs::path target = fs::absolute(place.target);
    by_folder[target.parent_path()].insert(target.filename().string());
  }
  for (const auto& [folder, names] : by_folder) {
    std::error_code unknown;
    if (changed.count(fs::canonical(folder, unknown)) > 0) continue;
    for (const std::string& stale : stale_beside(names, inputs)) {
      std::error_code ignored;
      if (names.count(stale) == 0) fs::remove(folder / stale, ignored);
    }
  }
}

void write_all(const std::vector<OutputFile>& files, std::vector<Place>& places,
               std::vector<FolderExchange>& exchanges, const std::vector<std::string>& inputs) {
  const auto give_up = [](const OutputFile& file, const std::string& why) {
    fail(file, "cannot write" + (why.empty() ? "" : ": " + why));
  };
  const auto write_those = [&](bool beside) {
    for (std::size_t i = 0; i < files.size(); ++i) {
      const Place& place = places[i];
      if (place.part.empty() == beside) continue;
      if (!(beside ? write_part(place.part, files[i].content)
                   : write(place.target, files[i].content))) {
        give_up(files[i], errno != 0 ? std::strerror(errno) : "");
      }
    }
  };
  write_those(true);
  write_those(false);
  std::set<fs::path> changed;
  std::erase_if(exchanges, [&](FolderExchange& exchange) {
    if (!exchange.put_in_place()) return false;
    changed.insert(exchange.folder());
    return true;
  });
  const auto write_beside = [&](std::size_t i) {
    places[i].part = places[i].target.parent_path() / unforeseeable_name();
    return write_part(places[i].part, files[i].content);
  };
  for (std::size_t i = 0; i < files.size(); ++i) {
    std::error_code error;
    if (places[i].part.empty() || !fs::exists(places[i].part, error)) continue;
    // A folder that is mounted there cannot be exchanged, and its files come from nowhere else.
    const bool elsewhere = places[i].part.parent_path() != places[i].target.parent_path();
    if (elsewhere && !write_beside(i)) give_up(files[i], std::strerror(errno));
    fs::rename(places[i].part, places[i].target, error);
    if (error) give_up(files[i], error.message());
  }
  remove_stale(places, changed, inputs);
  std::set<fs::path> folders;
  for (const Place& place : places) {
    const fs::path folder = fs::absolute(place.target).parent_path();
    folders.insert({folder, folder.parent_path()});
  }
  for (const fs::path& folder : folders) sync_folder(folder);
}

}  // namespace

void write_files(const std::vector<OutputFile>& files, const std::vector<std::string>& inputs) {
  refuse_inputs(files, inputs);
  refuse_one_place_for_two(files);
  Attempt attempt;
  for (const OutputFile& file : files) attempt.places.push_back(place_of(file, attempt));
  std::vector<FolderExchange> exchanges = exchanges_of(attempt.places, inputs);
  write_all(files, attempt.places, exchanges, inputs);
  attempt.keep();
}

std::vector<OutputFile> in_folder(const std::string& folder, const std::vector<ResultFile>& files) {
  std::vector<OutputFile> out;
  for (const ResultFile& file : files) {
    out.push_back({(std::filesystem::path(folder) / file.name).string(), file.content});
  }
  return out;
}

}  // namespace identikal
