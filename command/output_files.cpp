#include "command/output_files.h"

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>

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

Place place_of(const OutputFile& file, std::size_t index) {
  const fs::path given(file.path);
  const fs::path folder = given.parent_path();
  std::error_code error;
  if (!folder.empty()) {
    fs::create_directories(folder, error);
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
  out.part = out.target.parent_path() / fmt::format(".identikal-{}-{}.part", getpid(), index);
  return out;
}

bool write(const fs::path& path, const std::string& content) {
  errno = 0;
  std::ofstream out(path, std::ios::binary);
  out << content;
  out.close();
  return static_cast<bool>(out);
}

}  // namespace

void write_files(const std::vector<OutputFile>& files, const std::vector<std::string>& inputs) {
  for (const OutputFile& file : files) {
    for (const std::string& input : inputs) {
      std::error_code neither;
      if (!fs::is_regular_file(input, neither) || !fs::equivalent(file.path, input, neither))
        continue;
      throw InputError({file.path, 0, 0}, "would be written over, and this job reads it",
                       "another place with " + file.option);
    }
  }
  std::vector<Place> places;
  const auto give_up = [&](const OutputFile& file, const std::string& why) {
    std::error_code ignored;
    for (const Place& place : places) {
      if (!place.part.empty()) fs::remove(place.part, ignored);
    }
    fail(file, "cannot write" + (why.empty() ? "" : ": " + why));
  };
  for (const OutputFile& file : files) places.push_back(place_of(file, places.size()));
  for (std::size_t i = 0; i < files.size(); ++i) {
    if (!places[i].part.empty() && !write(places[i].part, files[i].content)) {
      give_up(files[i], errno != 0 ? std::strerror(errno) : "");
    }
  }
  for (std::size_t i = 0; i < files.size(); ++i) {
    if (places[i].part.empty() && !write(places[i].target, files[i].content)) {
      give_up(files[i], errno != 0 ? std::strerror(errno) : "");
    }
  }
  for (std::size_t i = 0; i < files.size(); ++i) {
    if (places[i].part.empty()) continue;
    std::error_code error;
    fs::rename(places[i].part, places[i].target, error);
    if (error) give_up(files[i], error.message());
  }
}

std::vector<OutputFile> in_folder(const std::string& folder, const std::vector<ResultFile>& files) {
  std::vector<OutputFile> out;
  for (const ResultFile& file : files) {
    out.push_back({(std::filesystem::path(folder) / file.name).string(), file.content});
  }
  return out;
}

}  // namespace identikal
