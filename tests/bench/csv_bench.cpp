// How many megabytes of numbers does one core parse in a second?
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <random>
#include <string>

#include <benchmark/benchmark.h>

#include "lib/data/csv.h"

namespace {

// `rows` lines of a time stamp and seven signals with 6 to 9 significant digits.
std::string write_recording(std::int64_t rows, char separator, char decimal_mark) {
  const std::string path = (std::filesystem::temp_directory_path() /
                            ("csv_bench_" + std::to_string(rows) + "_" +
                             std::to_string(static_cast<int>(decimal_mark)) + ".csv"))
                               .string();
  std::mt19937_64 engine(1);
  std::uniform_real_distribution<double> uniform(-40.0, 40.0);
  std::string text = "t,swa,vx,vy,yaw_rate,ay,ax,beta\n";
  char cell[32];
  for (std::int64_t row = 0; row < rows; ++row) {
    std::snprintf(cell, sizeof cell, "%.4f", 0.01 * static_cast<double>(row));
    text += cell;
    for (int column = 1; column < 8; ++column) {
      std::snprintf(cell, sizeof cell, ",%.*g", 6 + column % 4, uniform(engine));
      text += cell;
    }
    text += '\n';
  }
  for (char& c : text) {
    if (c == '.')
      c = decimal_mark;
    else if (c == ',')
      c = separator;
  }
  std::ofstream(path, std::ios::binary) << text;
  return path;
}

void read(benchmark::State& state, char separator, char decimal_mark) {
  const std::string path = write_recording(state.range(0), separator, decimal_mark);
  for (auto _ : state) benchmark::DoNotOptimize(identikal::read_csv(path));
  const auto bytes = static_cast<double>(std::filesystem::file_size(path));
  state.counters["MB/s"] =
      benchmark::Counter(1e-6 * bytes, benchmark::Counter::kIsIterationInvariantRate);
  state.counters["numbers/s"] = benchmark::Counter(8.0 * static_cast<double>(state.range(0)),
                                                   benchmark::Counter::kIsIterationInvariantRate);
  std::filesystem::remove(path);
}

void points(benchmark::State& state) { read(state, ',', '.'); }
void decimal_commas(benchmark::State& state) { read(state, ';', ','); }

BENCHMARK(points)->Arg(1000)->Arg(100'000)->Arg(1'000'000)->Unit(benchmark::kMillisecond);
BENCHMARK(decimal_commas)->Arg(100'000)->Unit(benchmark::kMillisecond);

}  // namespace

BENCHMARK_MAIN();
