#include "fleet/internal/worker.h"

#include <cmath>

#include "fleet/internal/message.h"
#include "fleet/task.h"
#include <malloc.h>
#include <sys/time.h>

#include "solvers/parallel.h"

namespace identikal {
namespace {

// 0: no alarm.
void set_alarm(double seconds) {
  itimerval timer{};
  timer.it_value.tv_sec = static_cast<time_t>(std::floor(seconds));
  timer.it_value.tv_usec = static_cast<suseconds_t>(1e6 * (seconds - std::floor(seconds)));
  setitimer(ITIMER_REAL, &timer, nullptr);
}

// Jobs are short and alike: memory that one has given back serves the next, instead of going back to
// the system and coming again page by page, which takes a seventh of a short fit.
void keep_memory() {
  mallopt(M_MMAP_THRESHOLD, 64 << 20);
  mallopt(M_TRIM_THRESHOLD, 256 << 20);
  mallopt(M_TOP_PAD, 16 << 20);
}

}  // namespace

void work_for_fleet(const FleetTask& task, double timeout, const Connection& connection) {
  keep_memory();
  use_threads_at_most(1);  // each processor has a process
  JobRunner runner(task);
  while (const std::optional<std::string> frame = connection.receive()) {
    const Assignment assignment = assignment_of(*frame);
    const std::int64_t number = assignment.job.number;
    set_alarm(timeout);
    // What is done is sent at once: when a process dies it is known what it was at.
    FleetResult done = runner.run(assignment.job, static_cast<std::size_t>(assignment.first_part),
                                  [&](FleetRow row) {
                                    connection.send(frame_of(RowMessage{number, std::move(row)}));
                                    set_alarm(timeout);
                                  });
    set_alarm(0.0);
    connection.send(frame_of(DoneMessage{std::move(done)}));
  }
}

}  // namespace identikal
