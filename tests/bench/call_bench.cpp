// What does ik_run("tune") cost beside the fit itself? The Nile, one start, through the C interface and through
// tune_ml(), the median of many calls: call_bench MODEL RECORDING [CALLS]; and how long is a fit with the default
// options where many series are fitted one after the other: call_bench MODEL RECORDING CALLS loop
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <vector>

#include "interface/identikal.h"

#include "identify/model/model_file.h"
#include "identify/model/recording.h"
#include "identify/noise/ml.h"
#include "lib/data/csv.h"

namespace {

// Of this thread on its processor, in microseconds: others may use the machine meanwhile.
double now() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return 1e6 * static_cast<double>(t.tv_sec) + 1e-3 * static_cast<double>(t.tv_nsec);
}

template <typename Work>
double time_of(const Work& work) {
  const double begin = now();
  work();
  return now() - begin;
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// Of series of their own: the recording and noise of variance 1.
void print_loop_of_fits(const identikal::Model& model, const std::vector<double>& y, int calls) {
  std::mt19937 random(1);
  std::normal_distribution<double> noise;
  std::vector<std::vector<double>> series(1000, y);
  for (std::vector<double>& each : series) {
    for (double& sample : each) sample += noise(random);
  }
  identikal::NoiseMlOptions options;
  options.pictures = false;
  const double whole = time_of([&] {
    for (int i = 0; i < calls; ++i) {
      const std::vector<double>& of = series[static_cast<std::size_t>(i) % series.size()];
      identikal::tune_ml(model, {identikal::recording(model, of, 1.0)}, options);
    }
  });
  std::printf("%.1f us a fit\n", whole / calls);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) return std::puts("call_bench MODEL RECORDING [CALLS]"), 2;
  const int calls = argc > 3 ? std::atoi(argv[3]) : 500;
  std::ifstream file(argv[1]);
  const std::string text(std::istreambuf_iterator<char>(file), {});
  const std::vector<double> y = identikal::read_csv(argv[2]).columns.back().values;

  const identikal::Model model = identikal::parse_model_file(text, "model");
  if (argc > 4 && std::string(argv[4]) == "loop") return print_loop_of_fits(model, y, calls), 0;
  ik_recording recording{};
  recording.y = y.data();
  recording.rows = y.size();
  recording.ny = 1;
  const std::vector<identikal::Dataset> data = {identikal::recording(model, y, 1.0)};
  for (const bool profiles : {true, false}) {
    const auto through_c = [&] {
      ik_result* result = nullptr;
      ik_run("tune", text.c_str(), &recording, 1, nullptr, 0,
             profiles ? R"({"starts": 1})" : R"({"starts": 1, "no-profiles": true})", nullptr,
             &result);
      ik_result_free(result);
    };
    identikal::NoiseMlOptions options;
    options.starts = 1;
    options.pictures = false;
    options.profiles = profiles;
    const auto directly = [&] { identikal::tune_ml(model, data, options); };
    // One after the other, so that both meet the machine as it is; the difference of two such
    // neighbours.
    std::vector<double> c, fit, beside;
    for (int i = 0; i < calls; ++i) {
      c.push_back(time_of(through_c));
      fit.push_back(time_of(directly));
      beside.push_back(c.back() - fit.back());
    }
    std::printf(
        "tune of %zu samples, %s profiles: ik_run %.0f us, tune_ml %.0f us, beside the fit %.0f "
        "us\n",
        y.size(), profiles ? "with" : "without", median(c), median(fit), median(beside));
  }
  return 0;
}
