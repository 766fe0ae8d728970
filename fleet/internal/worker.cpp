#include "fleet/internal/worker.h"

#include <chrono>
#include <cmath>

#include "fleet/internal/message.h"
#include "fleet/task.h"
#include <sys/time.h>

namespace identikal {
namespace {

using Clock = std::chrono::steady_clock;

// Frames wait so long, or until they are so many bytes, for others to go with.
constexpr auto kWait = std::chrono::milliseconds(50);
constexpr std::size_t kTogether = 32768;

void set_alarm(double seconds) {
  itimerval timer{};
  timer.it_value.tv_sec = static_cast<time_t>(std::floor(seconds));
  timer.it_value.tv_usec = static_cast<suseconds_t>(1e6 * (seconds - std::floor(seconds)));
  setitimer(ITIMER_REAL, &timer, nullptr);
}

}  // namespace

void work_for_fleet(const FleetTask& task, double timeout, const Connection& connection) {
  JobRunner runner(task);
  std::string waiting;
  Clock::time_point sent = Clock::now();
  const auto send_all = [&] {
    if (!waiting.empty()) connection.send(waiting);
    waiting.clear();
    sent = Clock::now();
  };
  const auto send = [&](const std::string& frame, bool now) {
    waiting += frame;
    if (now || waiting.size() >= kTogether || Clock::now() - sent >= kWait) send_all();
  };
  for (;;) {
    std::optional<std::string> frame = connection.receive(false);
    if (!frame) {
      send_all();
      frame = connection.receive(true);
    }
    if (!frame) return;
    const Assignment assignment = assignment_of(*frame);
    const std::int64_t number = assignment.job.number;
    if (timeout > 0.0) set_alarm(timeout);
    FleetResult done = runner.run(
        assignment.job, static_cast<std::size_t>(assignment.first_part), [&](FleetRow row) {
          send(frame_of(RowMessage{number, std::move(row)}), assignment.careful);
          if (timeout > 0.0) set_alarm(timeout);
        });
    if (timeout > 0.0) set_alarm(0.0);
    send(frame_of(DoneMessage{std::move(done)}), assignment.careful);
  }
}

}  // namespace identikal
