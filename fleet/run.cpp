#include "fleet/run.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <csignal>
#include <ctime>
#include <deque>
#include <iterator>
#include <new>

#include "fleet/internal/message.h"
#include "fleet/internal/mpi_world.h"
#include "fleet/internal/workers.h"
#include "fleet/task.h"
#include <fmt/chrono.h>
#include <fmt/format.h>

#include "lib/base/error.h"

namespace identikal {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point begin) {
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

// A job that a worker has, and what has come of it.
struct Task {
  Assignment assignment;
  std::vector<FleetRow> rows;
  int deaths = 0;      // of processes that were at it
  int given_up = 0;    // parts, one after the other
  bool again = false;  // a part of it failed so
};

// Jobs that are not done, in order. It asks the store for some at a time: a fleet may have millions.
class OpenJobs {
 public:
  explicit OpenJobs(FleetStore& store) : store_(&store), digest_(store.task().digest) {}

  std::optional<StoredJob> next() {
    for (;;) {
      if (page_.empty()) {
        const std::vector<StoredJob> jobs = store_->jobs_after(last_, kPage);
        if (jobs.empty()) return std::nullopt;
        page_.assign(jobs.begin(), jobs.end());
        last_ = jobs.back().number;
      }
      StoredJob job = std::move(page_.front());
      page_.pop_front();
      const bool done = job.task == digest_ && !job.again;
      if (!done || stamp_of(job.job.recording) != job.stamp) return job;
      ++done_;
    }
  }
  std::int64_t done_before() const { return done_; }

 private:
  static constexpr int kPage = 1000;
  FleetStore* store_;
  std::string digest_;
  std::deque<StoredJob> page_;
  std::int64_t last_ = -1, done_ = 0;
};

std::string time_text(double seconds) {
  if (seconds < 90.0) return fmt::format("{:.0f} s", seconds);
  if (seconds < 5400.0) return fmt::format("{:.0f} min", seconds / 60.0);
  return fmt::format("{:.1f} h", seconds / 3600.0);
}

std::string how_it_ended(const WorkerEvent& event) {
  if (event.without_memory) return "not enough memory";
  return event.signal != 0 ? fmt::format("signal {}", event.signal) : "without a signal";
}

class Coordinator {
 public:
  Coordinator(FleetStore& store, const FleetRun& run, const Workers& workers)
      : store_(store),
        task_(store.task()),
        run_(run),
        workers_(workers),
        jobs_(store),
        queues_(static_cast<std::size_t>(workers.count)),
        frames_(static_cast<std::size_t>(workers.count)) {
    out_.jobs = store.counts().jobs;
    out_.workers = workers.count;
  }

  FleetSummary work() {
    store_.begin();
    try {
      while (hand_out() > 0) {
        for (const WorkerEvent& event : workers_.wait(0.1)) take(event);
        if (seconds_since(committed_) > 1.0 || put_ > 20000) commit();
        if (!report()) {
          out_.stopped = true;
          break;
        }
      }
    } catch (...) {
      try {
        store_.commit();  // what is complete
      } catch (...) {
      }
      throw;
    }
    store_.commit();
    out_.unchanged += jobs_.done_before();
    out_.seconds = seconds_since(begin_);
    find_slowest();
    return out_;
  }

 private:
  // Gives every worker that has little to do some more. @return how many jobs are under way
  std::size_t hand_out() {
    std::size_t under_way = 0;
    for (std::size_t w = 0; w < queues_.size(); ++w) {
      std::deque<Task>& queue = queues_[w];
      const std::size_t batch = batch_size();
      if (2 * queue.size() < batch + 1) fill(w, batch);
      under_way += queue.size();
    }
    return under_way;
  }

  void fill(std::size_t w, std::size_t batch) {
    std::string frames;
    while (queues_[w].size() < batch) {
      std::optional<Task> task = next();
      if (!task) break;
      frames += frame_of(task->assignment);
      queues_[w].push_back(*std::move(task));
    }
    if (!frames.empty()) workers_.send(static_cast<int>(w), frames);
  }

  // What a process that has died left comes first.
  std::optional<Task> next() {
    std::optional<Task> out;
    if (!left_.empty()) {
      out = std::move(left_.front());
      left_.pop_front();
    } else if (std::optional<StoredJob> job = jobs_.next()) {
      out.emplace();
      out->assignment.job = *std::move(job);
    }
    return out;
  }

  // As many jobs as take a worker 0.1 s.
  std::size_t batch_size() const {
    if (usual_ <= 0.0) return 1;
    return static_cast<std::size_t>(std::clamp(0.1 / usual_, 1.0, 200.0));
  }

  void take(const WorkerEvent& event) {
    const auto w = static_cast<std::size_t>(event.worker);
    FrameReader& frames = frames_[w];
    frames.add(event.bytes);
    while (const std::optional<std::string> frame = frames.next()) {
      std::variant<RowMessage, DoneMessage> answer = answer_of(*frame);
      if (queues_[w].empty()) break;
      const std::int64_t number = queues_[w].front().assignment.job.number;
      if (RowMessage* row = std::get_if<RowMessage>(&answer)) {
        if (row->number != number) continue;
        queues_[w].front().rows.push_back(std::move(row->row));
        queues_[w].front().deaths = queues_[w].front().given_up = 0;
      } else {
        finish(w, std::get<DoneMessage>(std::move(answer)).result);
      }
    }
    if (event.ended) bury(w, event);
  }

  void finish(std::size_t w, FleetResult result) {
    Task task = std::move(queues_[w].front());
    queues_[w].pop_front();
    result.again = result.again || task.again;
    result.rows = std::move(task.rows);
    result.attempts = 1 + task.deaths;
    if (result.unchanged) {
      ++out_.unchanged;
    } else {
      ++out_.done_now;
      const double weight = usual_ > 0.0 ? 0.05 : 1.0;
      usual_ += weight * (std::max(result.seconds, 1e-6) - usual_);
      out_.working += result.seconds;
      note_slow(task.assignment.job.job.recording, result.seconds);
    }
    put(std::move(result));
  }

  void put(FleetResult result) {
    result.finished = fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::time(nullptr)));
    store_.put(result);
    ++put_;
  }

  // What it was at is tried again, and so is what it had before it.
  void bury(std::size_t w, const WorkerEvent& event) {
    if (!event.without_memory) ++out_.died;
    std::deque<Task> left = std::move(queues_[w]);
    queues_[w].clear();
    frames_[w] = {};
    workers_.restart(static_cast<int>(w));
    if (left.empty()) {
      if (++idle_deaths_ < 100) return;
      throw OutputError("the worker processes end before they get a recording; " +
                        how_it_ended(event));
    }
    Task& first = left.front();
    ++first.deaths;
    first.assignment.first_part = static_cast<std::int64_t>(first.rows.size());
    // More attempts would take as long and as much.
    const bool at_once = event.signal == SIGALRM || event.without_memory;
    if (at_once || first.deaths > run_.retries) {
      give_up(std::move(first), event);
      left.pop_front();
    }
    left_.insert(left_.begin(), std::make_move_iterator(left.begin()),
                 std::make_move_iterator(left.end()));
  }

  std::string why_given_up(const Task& task, const WorkerEvent& event) const {
    if (event.without_memory) return "not enough memory";
    if (event.signal == SIGALRM) {
      return fmt::format("took longer than {:g} s (--timeout)", run_.timeout);
    }
    return fmt::format("its process ended {} times ({})", task.deaths, how_it_ended(event));
  }

  void give_up(Task task, const WorkerEvent& event) {
    task.rows.push_back(failed_row(5, why_given_up(task, event)));
    task.again = true;
    // The next part may do better, unless the recording itself is too much.
    if (!task_.by.empty() && ++task.given_up < 3) {
      task.deaths = 0;
      task.assignment.first_part = static_cast<std::int64_t>(task.rows.size());
      left_.push_front(std::move(task));
      return;
    }
    FleetResult result;
    result.number = task.assignment.job.number;
    result.task = task_.digest;
    result.stamp = stamp_of(task.assignment.job.job.recording);
    result.again = true;
    result.attempts = std::max(1, task.deaths);
    result.rows = std::move(task.rows);
    ++out_.done_now;
    put(std::move(result));
  }

  void commit() {
    store_.commit();
    store_.begin();
    committed_ = Clock::now();
    put_ = 0;
  }

  bool report() {
    if (!run_.progress) return true;
    const double elapsed = seconds_since(begin_);
    const std::int64_t behind = out_.done_now + out_.unchanged + jobs_.done_before();
    const double share = out_.jobs > 0 ? static_cast<double>(behind) / out_.jobs : 1.0;
    std::string text = fmt::format("{} of {} recordings", behind, out_.jobs);
    if (out_.done_now > 0 && elapsed > 0.0) {
      const double rate = static_cast<double>(out_.done_now) / elapsed;
      text += fmt::format(", {:.3g}/s, {} to go", rate,
                          time_text(static_cast<double>(out_.jobs - behind) / rate));
    }
    if (out_.died > 0) text += fmt::format(", {} processes died", out_.died);
    return run_.progress(text, share);
  }

  void note_slow(const std::string& recording, double seconds) {
    if (seconds < 1.0) return;
    out_.slowest.push_back({recording, seconds});
    if (out_.slowest.size() > 1000) find_slowest();
  }

  void find_slowest() {
    const double usual =
        out_.done_now > 0 ? out_.working / static_cast<double>(out_.done_now) : 0.0;
    std::erase_if(out_.slowest, [&](const SlowJob& job) { return job.seconds < 10.0 * usual; });
    std::sort(out_.slowest.begin(), out_.slowest.end(),
              [](const SlowJob& a, const SlowJob& b) { return a.seconds > b.seconds; });
    if (out_.slowest.size() > 5) out_.slowest.resize(5);
  }

  FleetStore& store_;
  const FleetTask task_;
  const FleetRun& run_;
  const Workers& workers_;
  OpenJobs jobs_;
  std::vector<std::deque<Task>> queues_;
  std::vector<FrameReader> frames_;
  std::deque<Task> left_;
  FleetSummary out_;
  Clock::time_point begin_ = Clock::now(), committed_ = Clock::now();
  std::int64_t put_ = 0;
  int idle_deaths_ = 0;
  double usual_ = 0.0;  // seconds that a job takes
};

}  // namespace

FleetSummary run_fleet(FleetStore& store, const FleetRun& run, const Workers& workers) {
  return Coordinator(store, run, workers).work();
}

FleetSummary run_fleet(FleetStore& store, const FleetRun& run) {
  const FleetTask task = store.task();
  const int count = run.workers > 0 ? run.workers : usable_processors();
  const Workers workers = local_workers(
      count, [&](const Connection& connection) { work_for_fleet(task, run.timeout, connection); });
  return run_fleet(store, run, workers);
}

FleetSummary run_fleet_by_mpi(FleetStore& store, const FleetRun& run) {
  const FleetTask task = store.task();
  // Before MPI begins: it does not bear that a process doubles itself.
  const Workers own = local_workers(
      1, [&](const Connection& connection) { work_for_fleet(task, run.timeout, connection); });
  MpiWorld world;
  return run_fleet(store, run, world.workers(own));
}

void work_as_rank(const FleetTask& task, const FleetRun& run) {
  // Its end would be that of all ranks: a recording that is too large is given up by exception.
  std::set_new_handler(nullptr);
  MpiWorld world;
  work_for_fleet(task, run.timeout, world.connection());
}

}  // namespace identikal
