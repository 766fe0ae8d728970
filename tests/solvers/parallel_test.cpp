#include "solvers/parallel.h"

#include <atomic>
#include <cstdio>
#include <stdexcept>
#include <string>

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

namespace identikal {
namespace {

TEST(InParallel, DoesEveryTaskOnce) {
  for (const int threads : {0, 1, 3, 64}) {
    std::atomic<long> sum{0};
    in_parallel(100, threads, [&](int i) { sum += i + 1; });
    EXPECT_EQ(sum, 5050);
  }
}

TEST(InParallel, ThrowsTheFirstFailure) {
  try {
    in_parallel(100, 4, [](int i) {
      if (i >= 7) throw std::runtime_error(std::to_string(i));
    });
    FAIL();
  } catch (const std::runtime_error& error) {
    EXPECT_STREQ(error.what(), "7");
  }
}

// Address space of this process, in bytes; 0 where that is not known.
rlim_t address_space() {
  long pages = 0;
  if (std::FILE* file = std::fopen("/proc/self/statm", "r")) {
    if (std::fscanf(file, "%ld", &pages) != 1) pages = 0;
    std::fclose(file);
  }
  return static_cast<rlim_t>(pages) * static_cast<rlim_t>(sysconf(_SC_PAGESIZE));
}

TEST(InParallel, GoesOnWithTheThreadsThatTheSystemGives) {
  rlimit before{};
  ASSERT_EQ(getrlimit(RLIMIT_AS, &before), 0);
  const rlim_t now = address_space();
  if (now == 0 || now > (rlim_t{1} << 40))
    GTEST_SKIP() << "a sanitizer takes address space of its own";
  rlimit tight = before;
  tight.rlim_cur = now + (rlim_t{64} << 20);  // a few stacks
  ASSERT_EQ(setrlimit(RLIMIT_AS, &tight), 0);
  std::atomic<int> done{0};
  in_parallel(1000, 500, [&](int) {
    usleep(200);
    ++done;
  });
  ASSERT_EQ(setrlimit(RLIMIT_AS, &before), 0);
  EXPECT_EQ(done, 1000);
}

}  // namespace
}  // namespace identikal
