// The library instead of the command line: maximum likelihood of Q and R, the model written in C++.
#include <cstdio>

#include "identify/noise/ml.h"
#include "lib/data/csv.h"
#include "lib/data/dataset.h"

int main(int argc, char** argv) {
  using namespace identikal;
  if (argc != 2) {
    std::fprintf(stderr, "usage: %s data/nile.csv\n", argv[0]);
    return 2;
  }
  try {
    // x(t+1) = x + w, y = x + v: a level that wanders and is measured with an error.
    ModelFile model;
    model.name = "Nile";
    for (const char* name : {"q", "r"}) {
      Parameter variance;
      variance.name = name;
      variance.value = Eigen::MatrixXd::Constant(1, 1, 1000.0);
      variance.min = 0.0;
      model.parameters.push_back(variance);
    }
    LinearModel& linear = model.linear;
    linear.A.constant = linear.C.constant = linear.G.constant = Eigen::MatrixXd::Identity(1, 1);
    linear.B.constant.resize(1, 0);
    linear.D.constant.resize(1, 0);
    linear.Q.constant = linear.R.constant = linear.S.constant = Eigen::MatrixXd::Zero(1, 1);
    linear.Q.entries = {{0, 0, 0, 1.0}};
    linear.R.entries = {{0, 0, 1, 1.0}};
    linear.initial = InitialState::diffuse;

    TimeSource years;
    years.step = 1.0;
    const Dataset data =
        make_dataset(read_csv(argv[1]), years, {}, {{"level", "volume", "", "", {}}});
    const Estimate estimate = tune_ml(model, {data});
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
