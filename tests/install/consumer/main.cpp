// Somebody else's program: noise covariances of a recording, by the installed library.
#include <cstdio>

#include "identify/model/model_file.h"
#include "identify/noise/ml.h"
#include "lib/data/csv.h"
#include "lib/version.h"

int main(int argc, char** argv) {
  using namespace identikal;
  if (argc != 3) return 2;
  const Model model = read_model_file(argv[1]);
  const Dataset data = make_dataset(read_csv(argv[2]), model.time, model.inputs, model.outputs);
  const NoiseEstimate estimate = tune_ml(model, {data});
  std::printf("identikal %s\n", IDENTIKAL_VERSION);
  for (const EstimatedParameter& p : estimate.parameters) {
    std::printf("%s %.2f\n", p.name.c_str(), p.value);
  }
  std::printf("log-likelihood %.7f\n", estimate.objective.log_likelihood);
  return exit_code(estimate, false);
}
