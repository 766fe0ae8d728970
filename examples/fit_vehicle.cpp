// The library instead of the command line: cornering stiffnesses from a recording and a model file.
#include <cstdio>

#include "identify/model/model_file.h"
#include "identify/vehicle/fit.h"
#include "lib/data/csv.h"
#include "lib/data/dataset.h"

int main(int argc, char** argv) {
  using namespace identikal;
  if (argc != 3) {
    std::fprintf(stderr, "usage: %s MODEL.yaml DATA.csv\n", argv[0]);
    return 2;
  }
  try {
    const Model model = read_model_file(argv[1]);
    const Dataset data = make_dataset(read_csv(argv[2]), model.time, model.inputs, model.outputs);
    const VehicleEstimate estimate = fit_vehicle(model, data);
    for (const EstimatedParameter& p : estimate.parameters) {
      if (p.fixed) continue;
      std::printf("%s = %.5g %s, 95 %% within %.5g .. %.5g (%s)\n", p.name.c_str(), p.value,
                  p.unit.c_str(), p.ci95[0], p.ci95[1], to_string(p.verdict).c_str());
    }
    for (const Finding& finding : printed(estimate.findings))
      std::printf("%s: %s\n", name_of(finding).c_str(), finding.text.c_str());
    return exit_code(estimate, false);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  }
}
