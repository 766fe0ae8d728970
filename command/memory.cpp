#include "command/memory.h"

#include <cerrno>
#include <charconv>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <new>
#include <string_view>

#include <fmt/format.h>
#include <sys/resource.h>
#include <unistd.h>

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

// Nothing here asks for memory.
[[noreturn]] void say_and_end() {
  const std::exception_ptr why = std::current_exception();
  try {
    if (why) std::rethrow_exception(why);
  } catch (const std::bad_alloc&) {
    constexpr std::string_view kBegin = "identikal: ";
    for (const std::string_view part :
         {kBegin, std::string_view(kNotEnoughMemory), std::string_view("\n")}) {
      [[maybe_unused]] const auto written = write(STDERR_FILENO, part.data(), part.size());
    }
    _exit(5);
  } catch (...) {
  }
  std::abort();
}

}  // namespace

void limit_memory(const std::string& size) {
  const double bytes = bytes_of(size);
  if (!(bytes >= kLeast && bytes < 1e18)) {
    throw InputError({}, fmt::format("--memory-limit '{}' is no size", size),
                     "50 MB or more: '500 MB', '2 GB'");
  }
  rlimit limit = {};
  getrlimit(RLIMIT_AS, &limit);
  limit.rlim_cur = static_cast<rlim_t>(bytes);
  if (limit.rlim_max != RLIM_INFINITY && limit.rlim_cur > limit.rlim_max) return;  // is less
  if (setrlimit(RLIMIT_AS, &limit) != 0) {
    throw InputError({}, fmt::format("--memory-limit cannot be set: {}", std::strerror(errno)));
  }
}

void end_in_words_without_memory() { std::set_terminate(say_and_end); }

}  // namespace identikal
