#include "fleet/internal/workers.h"

#include <array>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <memory>
#include <new>
#include <utility>

#include "fleet/internal/message.h"
#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sched.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include "lib/base/error.h"

namespace identikal {
namespace {

constexpr std::size_t kPiece = 1 << 16;
constexpr int kWithoutMemory = 5;  // the code that a worker ends with

// The worker's end of the connection: frames come in, frames go out, both waited for.
Connection connection_on(int file) {
  const auto frames = std::make_shared<FrameReader>();
  Connection out;
  out.receive = [file, frames]() -> std::optional<std::string> {
    for (;;) {
      if (std::optional<std::string> frame = frames->next()) return frame;
      std::array<char, kPiece> piece;
      const ssize_t count = recv(file, piece.data(), piece.size(), 0);
      if (count < 0 && errno == EINTR) continue;
      if (count <= 0) return std::nullopt;
      frames->add({piece.data(), static_cast<std::size_t>(count)});
    }
  };
  out.send = [file](const std::string& bytes) {
    for (std::size_t sent = 0; sent < bytes.size();) {
      const ssize_t count = ::send(file, bytes.data() + sent, bytes.size() - sent, MSG_NOSIGNAL);
      if (count < 0 && errno == EINTR) continue;
      if (count < 0) _exit(0);  // nobody wants it any more
      sent += static_cast<std::size_t>(count);
    }
  };
  return out;
}

struct Process {
  pid_t id = -1;
  int file = -1;
  std::string outgoing;
  std::size_t sent = 0;
};

class ProcessPool {
 public:
  ProcessPool(int count, std::function<void(const Connection&)> work)
      : work_(std::move(work)), processes_(static_cast<std::size_t>(count)) {
    for (Process& process : processes_) start(process);
  }
  ~ProcessPool() {
    for (Process& process : processes_) {
      if (process.id > 0) kill(process.id, SIGKILL);
    }
    WorkerEvent unread;
    for (Process& process : processes_) end(process, unread);
  }
  ProcessPool(const ProcessPool&) = delete;
  ProcessPool& operator=(const ProcessPool&) = delete;

  void restart(int worker) { start(processes_[static_cast<std::size_t>(worker)]); }

  void send(int worker, const std::string& frame) {
    Process& process = processes_[static_cast<std::size_t>(worker)];
    process.outgoing += frame;
    flush(process);
  }

  std::vector<WorkerEvent> wait(double seconds) {
    std::vector<pollfd> files;
    for (const Process& process : processes_) {
      const short events = POLLIN | (process.sent < process.outgoing.size() ? POLLOUT : 0);
      files.push_back({process.file, events, 0});
    }
    std::vector<WorkerEvent> out;
    if (poll(files.data(), files.size(), static_cast<int>(1000.0 * seconds)) <= 0) return out;
    for (std::size_t i = 0; i < files.size(); ++i) {
      if ((files[i].revents & POLLOUT) != 0) flush(processes_[i]);
      if ((files[i].revents & (POLLIN | POLLHUP | POLLERR)) == 0) continue;
      out.push_back(read(static_cast<int>(i)));
    }
    return out;
  }

 private:
  void start(Process& process) {
    std::array<int, 2> ends;
    if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) != 0) {
      throw OutputError(fmt::format("no connection for a worker: {}", std::strerror(errno)));
    }
    const pid_t parent = getpid();
    const pid_t id = fork();
    if (id < 0) {
      close(ends[0]);
      close(ends[1]);
      throw OutputError(fmt::format("no process for a worker: {}", std::strerror(errno)));
    }
    if (id == 0) {
      close(ends[0]);
      become_worker(ends[1], parent);
    }
    close(ends[1]);
    process = {id, ends[0], "", 0};
  }

  [[noreturn]] void become_worker(int file, pid_t parent) {
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (getppid() != parent) _exit(0);
    // Ctrl-C reaches all processes of a terminal; the coordinator decides what it means.
    std::signal(SIGINT, SIG_IGN);
    std::signal(SIGTERM, SIG_DFL);
    std::signal(SIGALRM, SIG_DFL);
    // An exception would not do: see end_without_memory() of the program.
    std::set_new_handler([] { _exit(kWithoutMemory); });
    for (const Process& other : processes_) {
      if (other.file >= 0) close(other.file);
    }
    int code = 0;
    try {
      work_(connection_on(file));
    } catch (...) {
      code = 1;
    }
    _exit(code);
  }

  static void flush(Process& process) {
    while (process.sent < process.outgoing.size()) {
      const ssize_t count =
          ::send(process.file, process.outgoing.data() + process.sent,
                 process.outgoing.size() - process.sent, MSG_NOSIGNAL | MSG_DONTWAIT);
      if (count < 0 && errno == EINTR) continue;
      if (count < 0) return;  // it takes no more now, or has ended, which reading tells
      process.sent += static_cast<std::size_t>(count);
    }
    process.outgoing.clear();
    process.sent = 0;
  }

  WorkerEvent read(int worker) {
    Process& process = processes_[static_cast<std::size_t>(worker)];
    WorkerEvent event;
    event.worker = worker;
    std::array<char, kPiece> piece;
    for (;;) {
      const ssize_t count = recv(process.file, piece.data(), piece.size(), MSG_DONTWAIT);
      if (count > 0) {
        event.bytes.append(piece.data(), static_cast<std::size_t>(count));
        continue;
      }
      if (count < 0 && errno == EINTR) continue;
      const bool none_now = count < 0 && (errno == EAGAIN || errno == EWOULDBLOCK);
      if (none_now) return event;
      event.ended = true;
      end(process, event);
      return event;
    }
  }

  static void end(Process& process, WorkerEvent& event) {
    if (process.id < 0) return;
    int status = 0;
    while (waitpid(process.id, &status, 0) < 0 && errno == EINTR) {
    }
    close(process.file);
    process = {};
    event.signal = WIFSIGNALED(status) ? WTERMSIG(status) : 0;
    event.without_memory = WIFEXITED(status) && WEXITSTATUS(status) == kWithoutMemory;
  }

  std::function<void(const Connection&)> work_;
  std::vector<Process> processes_;
};

}  // namespace

Workers local_workers(int count, std::function<void(const Connection& connection)> work) {
  const auto pool = std::make_shared<ProcessPool>(count, std::move(work));
  Workers out;
  out.count = count;
  out.send = [pool](int worker, const std::string& frame) { pool->send(worker, frame); };
  out.wait = [pool](double seconds) { return pool->wait(seconds); };
  out.restart = [pool](int worker) { pool->restart(worker); };
  return out;
}

int usable_processors() {
  cpu_set_t set;
  if (sched_getaffinity(0, sizeof set, &set) != 0) return 1;
  return std::max(1, CPU_COUNT(&set));
}

}  // namespace identikal
