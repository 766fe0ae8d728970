#include "command/time_limit.h"

#include <csignal>
#include <string_view>

#include "jobs/unfinished_files.h"
#include <sys/time.h>
#include <unistd.h>

namespace identikal {
namespace {

// Nothing that asks for memory or locks is safe here.
void end(int) {
  remove_unfinished();
  constexpr std::string_view kText =
      "identikal: the time limit is over and there is no result yet; expected less data, or more "
      "time (--time-limit)\n";
  [[maybe_unused]] const auto written = write(STDERR_FILENO, kText.data(), kText.size());
  _exit(5);
}

}  // namespace

void end_after(long seconds) {
  struct sigaction action = {};
  action.sa_handler = end;
  sigemptyset(&action.sa_mask);
  sigaction(SIGALRM, &action, nullptr);
  itimerval timer = {};
  timer.it_value.tv_sec = seconds;
  setitimer(ITIMER_REAL, &timer, nullptr);
}

}  // namespace identikal
