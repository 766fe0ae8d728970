// Do many threads find what one finds, to the last bit? many_threads SOURCE [JOBS] [THREADS]
// Every job is done once by one thread; then each of the threads does JOBS of them, in another order. Under
// ThreadSanitizer (IDENTIKAL_SANITIZE_THREADS) it says as well what two of them touch at once.
#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <functional>
#include <iterator>
#include <string>
#include <thread>
#include <vector>

#include "interface/identikal.h"

#include "lib/data/csv.h"
#include "tests/interface/calls.h"

namespace {

using identikal::Result;

struct Recorded {
  std::string model;
  std::vector<double> y, u;  // row by row, in the units of the model's columns
  std::size_t rows = 0, ny = 0, nu = 0;
};

std::string text_of(const std::string& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

Recorded recorded(const std::string& model, const std::string& data,
                  std::vector<const char*> outputs, std::vector<const char*> inputs) {
  const identikal::Table table = identikal::read_csv(data);
  Recorded out{text_of(model), {}, {}, 0, outputs.size(), inputs.size()};
  const auto column = [&](const char* name) -> const std::vector<double>& {
    for (const identikal::Column& each : table.columns) {
      if (each.name == name) return each.values;
    }
    std::printf("%s has no column %s\n", data.c_str(), name);
    std::exit(2);
  };
  out.rows = column(outputs[0]).size();
  for (std::size_t t = 0; t < out.rows; ++t) {
    for (const char* name : outputs) out.y.push_back(column(name)[t]);
    for (const char* name : inputs) out.u.push_back(column(name)[t]);
  }
  return out;
}

struct Job {
  const char* verb;
  const Recorded* of;
  std::string options;
  double step;
  bool with_outputs;
};

// What a job finds: code, JSON without the time that it took, and the bytes of its series.
std::string found(const Job& job) {
  ik_recording recording{};
  recording.rows = job.of->rows;
  recording.step = job.step;
  recording.y = job.of->y.data();
  recording.u = job.of->u.data();
  recording.ny = job.of->ny;
  recording.nu = job.of->nu;
  const Result result(
      job.verb, job.of->model.c_str(),
      job.with_outputs ? std::vector<ik_recording>{recording} : std::vector<ik_recording>{},
      job.options.c_str());
  const std::string json = result.json();
  std::string out = std::to_string(result.code) + json.substr(0, json.find("\"timing_s\""));
  for (const char* name : {"predicted", "innovations", "states", "tracked"}) {
    const std::vector<double> series = result.series(name);
    out.append(reinterpret_cast<const char*>(series.data()), series.size() * sizeof(double));
  }
  if (json.empty()) std::printf("%s: %s\n", job.verb, result.message().c_str());
  return out;
}

std::vector<Job> jobs_of(const Recorded& nile, const Recorded& tracker, const Recorded& car) {
  std::vector<Job> out;
  for (int i = 1; i <= 20; ++i) {
    const auto set = [i](const char* name, double unit) {
      return std::string("{\"set\": [\"") + name + "=" + std::to_string(unit * i) + "\"]}";
    };
    const std::string seed = std::to_string(i);
    out.push_back({"tune", &nile, "{\"starts\": 1, \"seed\": " + seed + "}", 1.0, true});
    out.push_back({"filter", &nile, set("q", 100.0), 1.0, true});
    out.push_back({"check", &nile, set("r", 1500.0), 1.0, true});
    out.push_back({"bound", &nile, "{\"rows\": " + std::to_string(20 * i) + "}", 1.0, false});
    out.push_back({"simulate", &nile, "{\"rows\": 50, \"seed\": " + seed + "}", 1.0, false});
    out.push_back({"track", &nile,
                   "{\"particles\": 20, \"adaptive\": true, \"seed\": " + seed + "}", 1.0, true});
    out.push_back({"tune", &tracker, "{\"starts\": 1, \"seed\": " + seed + "}", 0.1, true});
    out.push_back({"filter", &tracker, "{}", 0.1, true});
    if (i <= 4) out.push_back({"fit", &car, "{\"starts\": 1, \"seed\": " + seed + "}", 0.1, true});
  }
  return out;
}

double seconds_of(const std::function<void()>& work) {
  const auto begin = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) return std::puts("many_threads SOURCE [JOBS] [THREADS]"), 2;
  const std::string source = argv[1];
  const std::size_t each = argc > 2 ? std::strtoul(argv[2], nullptr, 10) : 100;
  const std::size_t count = argc > 3 ? std::strtoul(argv[3], nullptr, 10) : 8;
  const Recorded nile =
      recorded(source + "/examples/nile.yaml", source + "/data/nile.csv", {"volume"}, {});
  const std::vector<double> positions = identikal::walk(200);
  const Recorded tracker{text_of(source + "/examples/tracker.yaml"), positions, {}, 200, 1, 0};
  const Recorded car =
      recorded(source + "/examples/severe_lane_change.yaml",
               source + "/data/severe_lane_change.csv", {"yaw_rate", "vy"}, {"swa", "speed"});
  const std::vector<Job> jobs = jobs_of(nile, tracker, car);
  std::vector<std::string> serial;
  std::size_t failed = 0;
  const double alone = seconds_of([&] {
    for (const Job& job : jobs) {
      serial.push_back(found(job));
      failed += serial.back().size() < 2;
    }
  });
  std::atomic<std::size_t> other{0};
  const double together = seconds_of([&] {
    std::vector<std::thread> threads;
    for (std::size_t k = 0; k < count; ++k) {
      threads.emplace_back([&, k] {
        for (std::size_t i = 0; i < each; ++i) {
          const std::size_t job = (i * (2 * k + 1) + 31 * k) % jobs.size();
          if (found(jobs[job]) != serial[job]) ++other;
        }
      });
    }
    for (std::thread& thread : threads) thread.join();
  });
  std::printf("%zu different jobs by one thread: %.1f s\n", jobs.size(), alone);
  std::printf("%zu threads with %zu jobs each: %.1f s, %zu results differ, %zu failed\n", count,
              each, together, other.load(), failed);
  return other == 0 && failed == 0 ? 0 : 1;
}
