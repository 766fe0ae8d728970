// How long does it take to make the digest of 10^8 samples of System 7, how large is it, and how long is a fit from it?
#include <chrono>
#include <cmath>
#include <cstdio>
#include <functional>

#include "identify/filter/digest_file.h"
#include "identify/noise/ml.h"
#include "tests/support/matisko_systems.h"
#include "tests/support/scalar_case.h"

using namespace identikal;

namespace {

double seconds_of(const std::function<void()>& work) {
  const auto begin = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

}  // namespace

int main(int argc, char** argv) {
  MatiskoSystem system = matisko_system(7);
  system.samples = argc > 1 ? std::atoll(argv[1]) : 100000000;
  Random random(9);
  const std::vector<Dataset> recordings{dataset_of(simulate_matisko(system, random))};
  std::vector<RecordingDigest> digests(1);
  const double made = seconds_of([&] { digests[0] = digest_of(system.model, recordings[0], 64); });
  NoiseMlOptions options;
  options.profiles = false;
  options.starts = 1;
  NoiseEstimate small, whole;
  double fit = HUGE_VAL, with_profiles = HUGE_VAL;
  for (int i = 0; i < 10; ++i) {
    fit =
        std::min(fit, seconds_of([&] { small = tune_ml_digests(system.model, digests, options); }));
    with_profiles =
        std::min(with_profiles, seconds_of([&] { tune_ml_digests(system.model, digests); }));
  }
  std::printf("%td samples: digest in %.2f s (%.1f million samples a second), %zu bytes\n",
              recordings[0].size(), made, 1e-6 * static_cast<double>(recordings[0].size()) / made,
              bytes_of(digests[0]).size());
  std::printf("fit from it %.2f ms, with profiles and further starts %.2f ms\n", 1e3 * fit,
              1e3 * with_profiles);
  if (recordings[0].size() > 10000000) return 0;  // the fit of so many takes 30 GB
  const double direct = seconds_of([&] { whole = tune_ml(system.model, recordings, options); });
  double worst = 0.0;
  for (std::size_t i = 0; i < whole.parameters.size(); ++i) {
    if (whole.parameters[i].fixed) continue;
    worst = std::max(worst, std::abs(small.parameters[i].value / whole.parameters[i].value - 1.0));
  }
  std::printf(
      "fit of the recording %.2f s, its tests included; greatest relative difference %.1e\n",
      direct, worst);
}
