#include "command/memory.h"

#include <atomic>
#include <cerrno>
#include <charconv>
#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <new>
#include <string_view>

#include "jobs/unfinished_files.h"
#include <fmt/format.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <unistd.h>

#ifdef __GLIBC__
#include <malloc.h>
#endif

#include "lib/base/error.h"

namespace identikal {
namespace {

constexpr double kLeast = 50e6;  // what it takes to say that there is too little

// Bytes; 0 where the text is no size.
double bytes_of(std::string_view text) {
  double value = 0.0;
  const auto [end, problem] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (problem != std::errc()) return 0.0;
  std::string_view unit(end, static_cast<std::size_t>(text.data() + text.size() - end));
  while (unit.starts_with(' ')) unit.remove_prefix(1);
  if (unit == "MB") return value * 1e6;
  return unit == "GB" ? value * 1e9 : 0.0;
}

[[noreturn]] void say_and_end() {
  // The first to fail says so; other threads wait for the end.
  static std::atomic_flag ending = ATOMIC_FLAG_INIT;
  while (ending.test_and_set()) pause();
  remove_unfinished();
  for (const std::string_view part : {std::string_view("identikal: "),
                                      std::string_view(kNotEnoughMemory), std::string_view("\n")}) {
    [[maybe_unused]] const auto written = write(STDERR_FILENO, part.data(), part.size());
  }
  _exit(5);
}

}  // namespace

#if defined(__GLIBC__) && defined(MADV_HUGEPAGE)
namespace {

// Bytes by which the heap grows: pages that nobody touches cost nothing.
constexpr int kAtOnce = 64 << 20;
constexpr int kUsualStep = 128 << 10;  // glibc's own
constexpr int kApart = 32 << 20;       // what is larger is given back when it is no longer used
constexpr std::size_t kPage = 2 << 20;

}  // namespace

void take_large_pages() {
  rlimit limit = {};
  if (getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur != RLIM_INFINITY) return;
  mallopt(M_TOP_PAD, kAtOnce);
  mallopt(M_MMAP_THRESHOLD, kApart);
  mallopt(M_TRIM_THRESHOLD, 2 * kAtOnce);
  void* volatile grows = std::malloc(2 * kUsualStep);
  std::free(grows);
  void* first = static_cast<char*>(sbrk(0)) - kAtOnce;
  std::size_t size = kAtOnce;
  if (std::align(kPage, kPage, first, size) != nullptr) madvise(first, size, MADV_HUGEPAGE);
}
#else
void take_large_pages() {}
#endif

void limit_memory(const std::string& size) {
  const double bytes = bytes_of(size);
  if (!(bytes >= kLeast && bytes < 1e18)) {
    throw InputError({}, fmt::format("--memory-limit '{}' is no size", size),
                     "50 MB or more: '500 MB', '2 GB'");
  }
#ifdef __GLIBC__
  mallopt(M_TOP_PAD, 0);
  malloc_trim(0);  // what was taken ahead does not count
#endif
  rlimit limit = {};
  getrlimit(RLIMIT_AS, &limit);
  limit.rlim_cur = static_cast<rlim_t>(bytes);
  if (limit.rlim_max != RLIM_INFINITY && limit.rlim_cur > limit.rlim_max) return;  // is less
  if (setrlimit(RLIMIT_AS, &limit) != 0) {
    throw InputError({}, fmt::format("--memory-limit cannot be set: {}", std::strerror(errno)));
  }
}

void end_without_memory() { std::set_new_handler(say_and_end); }

void memory_has_failed() noexcept {
  if (const std::new_handler end = std::get_new_handler()) end();
}

}  // namespace identikal
