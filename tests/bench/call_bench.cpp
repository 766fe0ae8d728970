// What does ik_run("tune") cost beside the fit itself? The Nile, one start, through the C interface and through
// tune_ml(), the least of many calls each: call_bench MODEL RECORDING [CALLS]
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <iterator>
#include <limits>
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
void keep_least(double& least, const Work& work) {
  const double begin = now();
  work();
  least = std::min(least, now() - begin);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) return std::puts("call_bench MODEL RECORDING [CALLS]"), 2;
  const int calls = argc > 3 ? std::atoi(argv[3]) : 500;
  std::ifstream file(argv[1]);
  const std::string text(std::istreambuf_iterator<char>(file), {});
  const std::vector<double> y = identikal::read_csv(argv[2]).columns.back().values;

  ik_recording recording{};
  recording.y = y.data();
  recording.rows = y.size();
  recording.ny = 1;
  const auto through_c = [&] {
    ik_result* result = nullptr;
    ik_run("tune", text.c_str(), &recording, 1, nullptr, 0, R"({"starts": 1})", nullptr, &result);
    ik_result_free(result);
  };
  const identikal::Model model = identikal::parse_model_file(text, "model");
  const std::vector<identikal::Dataset> data = {identikal::recording(model, y, 1.0)};
  identikal::NoiseMlOptions options;
  options.starts = 1;
  options.pictures = false;
  const auto directly = [&] { identikal::tune_ml(model, data, options); };

  double c = std::numeric_limits<double>::infinity(), fit = c;
  for (int i = 0; i < calls; ++i) {
    keep_least(c, through_c);
    keep_least(fit, directly);
  }
  std::printf("tune of %zu samples: ik_run %.0f us, tune_ml %.0f us, beside the fit %.0f us\n",
              y.size(), c, fit, c - fit);
  return 0;
}
