#include "solvers/parallel.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

namespace identikal {

namespace {

std::atomic<int> most_threads{0};
thread_local bool is_alone = false;

// Asked of the system once: it reads a file for the answer, which takes as long as a part of a
// short fit.
int cores() {
  static const int count = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  return count;
}

int threads_for(int count, int asked) {
  if (is_alone) return 1;
  int out = count;
  if (asked > 0) out = std::min(out, asked);
  if (most_threads > 0) out = std::min(out, most_threads.load());
  if (asked <= 0 && out > 1) out = std::min(out, cores());
  return out;
}

}  // namespace

OneThread::OneThread() : before_(is_alone) { is_alone = true; }

OneThread::~OneThread() { is_alone = before_; }

void use_threads_at_most(int threads) { most_threads = threads; }

void in_parallel(int count, int threads, const std::function<void(int task)>& task) {
  std::atomic<int> next{0};
  std::mutex mutex;  // of what follows
  int failed = count;
  std::exception_ptr failure;
  const auto work = [&] {
    for (;;) {
      const int i = next++;
      if (i >= count) return;
      try {
        task(i);
      } catch (...) {
        // Every earlier task has been taken, so the first failure is among those under way.
        next = count;
        const std::lock_guard<std::mutex> lock(mutex);
        if (i < failed) {
          failed = i;
          failure = std::current_exception();
        }
      }
    }
  };
  const int together = threads_for(count, threads);
  std::vector<std::thread> others;
  others.reserve(static_cast<std::size_t>(std::max(together, 0)));
  try {
    for (int t = 1; t < together; ++t) others.emplace_back(work);
  } catch (const std::system_error&) {
    // The system gives no more: those that there are share the work.
  }
  work();
  for (std::thread& other : others) other.join();
  if (failure) std::rethrow_exception(failure);
}

}  // namespace identikal
