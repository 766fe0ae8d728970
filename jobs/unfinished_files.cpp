#include "jobs/unfinished_files.h"

#include <mutex>
#include <utility>
#include <vector>

#include <unistd.h>

namespace identikal {
namespace {

struct Noted {
  std::mutex mutex;
  std::vector<std::string> paths;
};

Noted& noted() {
  static Noted all;
  return all;
}

}  // namespace

void note_unfinished(std::string path) {
  Noted& all = noted();
  const std::lock_guard<std::mutex> lock(all.mutex);
  all.paths.push_back(std::move(path));
}

void forget_unfinished() {
  Noted& all = noted();
  const std::lock_guard<std::mutex> lock(all.mutex);
  all.paths.clear();
}

void remove_unfinished() noexcept {
  // Whoever holds the lock may be the one that has found no memory: not waited for.
  std::vector<std::string>& paths = noted().paths;
  for (auto path = paths.rbegin(); path != paths.rend(); ++path) {
    if (unlink(path->c_str()) != 0) rmdir(path->c_str());
  }
}

}  // namespace identikal
