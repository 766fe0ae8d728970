#include "command/interruption.h"

#include <csignal>
#include <string_view>

#include <unistd.h>

namespace identikal {
namespace {

volatile std::sig_atomic_t received = 0;

// Nothing but write() is safe here.
void note_signal(int signal) {
  received = signal;
  constexpr std::string_view kText =
      "\nidentikal: stops with the best so far; once more ends it at once\n";
  [[maybe_unused]] const auto written = write(STDERR_FILENO, kText.data(), kText.size());
}

}  // namespace

void stop_at_signals() {
  for (const int signal : {SIGINT, SIGTERM}) {
    struct sigaction now = {};
    if (sigaction(signal, nullptr, &now) != 0 || now.sa_handler == SIG_IGN) continue;
    struct sigaction action = {};
    action.sa_handler = note_signal;
    sigemptyset(&action.sa_mask);
    action.sa_flags = SA_RESETHAND | SA_RESTART;
    sigaction(signal, &action, nullptr);
  }
}

void end_at_signals() {
  for (const int signal : {SIGINT, SIGTERM}) {
    struct sigaction now = {};
    if (sigaction(signal, nullptr, &now) == 0 && now.sa_handler == note_signal) {
      std::signal(signal, SIG_DFL);
    }
  }
  if (received != 0) std::raise(received);
}

int signal_received() { return received; }

}  // namespace identikal
