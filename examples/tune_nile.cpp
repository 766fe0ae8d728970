// The library instead of the command line: maximum likelihood of Q and R, the model written in C++.
#include <cstdio>

#include "identify/model/builder.h"
#include "identify/model/recording.h"
#include "identify/noise/ml.h"
#include "lib/data/csv.h"

int main(int argc, char** argv) {
  using namespace identikal;
  if (argc != 2) {
    std::fprintf(stderr, "usage: %s data/nile.csv\n", argv[0]);
    return 2;
  }
  try {
    // x(t+1) = x + w, y = x + v: a level that wanders and is measured with an error.
    const Model level = linear_model()
                            .A(1)
                            .C(1)
                            .process_noise(variance("q", 1000))
                            .measurement_noise(variance("r", 1000))
                            .diffuse();
    const Table file = read_csv(argv[1]);
    const Dataset years = recording(level, file.find("volume")->values, 1.0);
    const NoiseEstimate estimate = tune_ml(level, {years});
    for (const EstimatedParameter& p : estimate.parameters) {
      std::printf("%s = %.2f +- %.2f (%s)\n", p.name.c_str(), p.value, p.se,
                  to_string(p.verdict).c_str());
    }
    std::printf("log-likelihood %.6f\n", estimate.objective.log_likelihood);
    return exit_code(estimate, false);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  }
}
