#include "jobs/folder_exchange.h"

#include <algorithm>
#include <random>
#include <utility>
#include <vector>

#include "jobs/unfinished_files.h"
#include <fcntl.h>
#include <fmt/format.h>
#include <stdio.h>  // renameat2
#include <sys/stat.h>
#include <unistd.h>

namespace identikal {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostEntries = 1000;  // more are no folder of a result

bool is_within(const fs::path& inner, const fs::path& outer) {
  return std::mismatch(outer.begin(), outer.end(), inner.begin(), inner.end()).first == outer.end();
}

// Only files of ours, as far as can be told, and nobody works in it.
bool may_be_exchanged(const fs::path& folder) {
  struct stat about = {};
  if (lstat(folder.c_str(), &about) != 0 || !S_ISDIR(about.st_mode)) return false;
  if (about.st_uid != geteuid()) return false;
  std::error_code error;
  if (is_within(fs::current_path(error), folder) || error) return false;
  std::size_t entries = 0;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
    if (entry.is_symlink(error) || !entry.is_regular_file(error)) return false;
    if (++entries > kMostEntries) return false;
  }
  return !error;
}

}  // namespace

std::string unforeseeable_name() {
  std::random_device device;
  return fmt::format(".identikal-{:08x}{:08x}.part", device(), device());
}

std::optional<FolderExchange> FolderExchange::beside(const fs::path& given,
                                                     std::set<std::string> names,
                                                     std::set<std::string> stale) {
  std::error_code error;
  const fs::path folder = fs::canonical(given, error);
  if (error || !folder.has_relative_path() || !may_be_exchanged(folder)) return std::nullopt;
  const fs::path fresh = folder.parent_path() / unforeseeable_name();
  note_unfinished(fresh);
  if (mkdir(fresh.c_str(), 0700) != 0) return std::nullopt;
  return FolderExchange(folder, fresh, std::move(names), std::move(stale));
}

FolderExchange::FolderExchange(fs::path folder, fs::path fresh, std::set<std::string> names,
                               std::set<std::string> stale)
    : folder_(std::move(folder)),
      fresh_(std::move(fresh)),
      names_(std::move(names)),
      stale_(std::move(stale)) {}

FolderExchange::FolderExchange(FolderExchange&& other) noexcept
    : folder_(std::move(other.folder_)),
      fresh_(std::exchange(other.fresh_, fs::path())),
      names_(std::move(other.names_)),
      stale_(std::move(other.stale_)) {}

FolderExchange& FolderExchange::operator=(FolderExchange&& other) noexcept {
  std::swap(folder_, other.folder_);
  std::swap(fresh_, other.fresh_);
  std::swap(names_, other.names_);
  std::swap(stale_, other.stale_);
  return *this;
}

FolderExchange::~FolderExchange() {
  std::error_code ignored;
  if (!fresh_.empty()) fs::remove_all(fresh_, ignored);
}

// The same files under a second name: what is written to them meanwhile is kept.
bool FolderExchange::carry_over() {
  std::error_code error;
  std::vector<std::string> others;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder_, error)) {
    const std::string name = entry.path().filename().string();
    if (names_.count(name) == 0 && stale_.count(name) == 0) others.push_back(name);
  }
  if (error) return false;
  // These, or behind the exchange the old ones, are to go with the folder.
  for (const std::string& name : others) note_unfinished(fresh_ / name);
  for (const std::string& name : stale_) note_unfinished(fresh_ / name);
  return std::all_of(others.begin(), others.end(), [&](const std::string& name) {
    return link((folder_ / name).c_str(), (fresh_ / name).c_str()) == 0;
  });
}

bool FolderExchange::put_in_place() {
  struct stat about = {};
  if (!carry_over() || stat(folder_.c_str(), &about) != 0) return false;
  if (chmod(fresh_.c_str(), about.st_mode & 07777) != 0) return false;
  if (renameat2(AT_FDCWD, fresh_.c_str(), AT_FDCWD, folder_.c_str(), RENAME_EXCHANGE) != 0) {
    return false;
  }
  clear_old();
  return true;
}

// What somebody has laid there since goes to where it was meant to be.
void FolderExchange::clear_old() {
  std::error_code error;
  std::vector<std::string> old;
  for (const fs::directory_entry& entry : fs::directory_iterator(fresh_, error)) {
    old.push_back(entry.path().filename().string());
  }
  for (const std::string& name : old) {
    const bool known = names_.count(name) > 0 || stale_.count(name) > 0;
    const fs::path here = fresh_ / name, there = folder_ / name;
    if (!known &&
        renameat2(AT_FDCWD, here.c_str(), AT_FDCWD, there.c_str(), RENAME_NOREPLACE) == 0) {
      continue;
    }
    fs::remove(here, error);
  }
  fs::remove(fresh_, error);
  fresh_.clear();
}

}  // namespace identikal
