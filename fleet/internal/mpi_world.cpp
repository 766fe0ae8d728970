#include "fleet/internal/mpi_world.h"

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <utility>

#include "fleet/internal/message.h"
#include "fleet/internal/mpi_plugin.h"
#include <dlfcn.h>
#include <fmt/format.h>

#include "lib/base/error.h"

namespace identikal {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr const char* kFile = "libidentikal_mpi.so";

// Beside the program, or where it is installed.
void* loaded() {
  std::error_code ignored;
  const fs::path program = fs::read_symlink("/proc/self/exe", ignored).parent_path();
  std::string said;
  for (const fs::path& path :
       {program / kFile, program / "../lib/identikal" / kFile, fs::path(kFile)}) {
    // Global: MPI's own plugins look for its names.
    if (void* library = dlopen(path.c_str(), RTLD_NOW | RTLD_GLOBAL)) return library;
    if (fs::exists(path, ignored) || said.empty()) said = dlerror();
  }
  throw OutputError(
      fmt::format("--engine mpi: {}; it is built where MPI is found (on Debian "
                  "libopenmpi-dev)",
                  said));
}

}  // namespace

struct MpiWorld::Library {
  void* handle = loaded();
  decltype(&identikal_mpi_begin) begin = find<decltype(begin)>("identikal_mpi_begin");
  decltype(&identikal_mpi_send) send = find<decltype(send)>("identikal_mpi_send");
  decltype(&identikal_mpi_receive) receive = find<decltype(receive)>("identikal_mpi_receive");
  decltype(&identikal_mpi_end) end = find<decltype(end)>("identikal_mpi_end");
  int rank = 0, size = 1;

  ~Library() { end(); }

  // The next message and who sent it.
  std::optional<std::pair<int, std::string>> next(bool wait) {
    int from = 0;
    std::string bytes;
    const auto take = [](void* user, const char* data, std::size_t count) {
      static_cast<std::string*>(user)->assign(data, count);
    };
    if (receive(wait ? 1 : 0, &from, take, &bytes) == 0) return std::nullopt;
    return std::pair(from, std::move(bytes));
  }

 private:
  template <typename Function>
  Function find(const char* name) const {
    void* const found = dlsym(handle, name);
    if (found == nullptr) throw OutputError(fmt::format("{} has no {}", kFile, name));
    return reinterpret_cast<Function>(found);
  }
};

MpiWorld::MpiWorld() : library_(std::make_shared<Library>()) {
  if (library_->begin(&library_->rank, &library_->size) != 0) {
    throw OutputError("--engine mpi: MPI cannot begin");
  }
}

MpiWorld::~MpiWorld() = default;

int MpiWorld::rank() const { return library_->rank; }
int MpiWorld::size() const { return library_->size; }

Connection MpiWorld::connection() {
  const auto frames = std::make_shared<FrameReader>();
  Connection out;
  out.receive = [library = library_, frames]() -> std::optional<std::string> {
    for (;;) {
      if (std::optional<std::string> frame = frames->next()) return frame;
      const auto message = library->next(true);
      if (message->second.empty()) return std::nullopt;
      frames->add(message->second);
    }
  };
  out.send = [library = library_](const std::string& bytes) {
    library->send(0, bytes.data(), bytes.size());
  };
  return out;
}

Workers MpiWorld::workers(const Workers& own) {
  // An empty message says that no more will come.
  const std::shared_ptr<void> told(nullptr, [library = library_](void*) {
    for (int rank = 1; rank < library->size; ++rank) library->send(rank, "", 0);
  });
  Workers out;
  out.count = own.count + library_->size - 1;
  out.send = [library = library_, own, told](int worker, const std::string& frame) {
    if (worker < own.count) {
      own.send(worker, frame);
    } else {
      library->send(worker - own.count + 1, frame.data(), frame.size());
    }
  };
  out.restart = own.restart;  // a rank that ends takes all others with it
  out.wait = [library = library_, own](double seconds) {
    const auto end = Clock::now() + std::chrono::duration<double>(seconds);
    std::vector<WorkerEvent> events;
    while (events.empty() && Clock::now() < end) {
      while (auto message = library->next(false)) {
        events.push_back({message->first - 1 + own.count, std::move(message->second), false, 0});
      }
      // MPI has nothing that could be waited for together with other files.
      for (WorkerEvent& event : own.wait(events.empty() ? 0.001 : 0.0)) {
        events.push_back(std::move(event));
      }
    }
    return events;
  };
  return out;
}

int rank_by_environment() {
  for (const char* name : {"OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PMI_RANK"}) {
    if (const char* rank = std::getenv(name)) return std::atoi(rank);
  }
  return 0;
}

}  // namespace identikal
