// Tunes a filter that knows nothing of this library: a function that runs it is enough.
#include <cstdio>

#include "identify/noise/external_filter.h"
#include "lib/data/csv.h"
#include "lib/data/dataset.h"

namespace {

// Somebody else's filter for a level that wanders.
struct LevelFilter {
  double process_variance, sensor_variance;
  double level = 1000.0, variance = 1e6;

  double innovation = 0.0, innovation_variance = 0.0;
  void measure(double value) {
    innovation = value - level;
    innovation_variance = variance + sensor_variance;
    level += variance / innovation_variance * innovation;
    variance *= sensor_variance / innovation_variance;
    variance += process_variance;
  }
};

}  // namespace

int main(int argc, char** argv) {
  using namespace identikal;
  if (argc != 2) {
    std::fprintf(stderr, "usage: %s data/nile.csv\n", argv[0]);
    return 2;
  }
  try {
    TimeSource years;
    years.step = 1.0;
    const Dataset data =
        make_dataset(read_csv(argv[1]), years, {}, {{"level", "volume", "", "", {}}});
    ParameterSet parameters(2);  // as the filter has them now, badly
    for (std::size_t i = 0; i < 2; ++i) {
      parameters[i].name = i == 0 ? "process variance" : "sensor variance";
      parameters[i].value = Eigen::MatrixXd::Constant(1, 1, 10.0);
      parameters[i].min = 0.0;
    }
    const NoiseEstimate estimate =
        fit_external_filter(parameters, [&](const ParameterSet& at) -> std::optional<Innovations> {
          LevelFilter filter{at[0].scalar(), at[1].scalar()};
          Innovations out{data.y, {}};
          for (Eigen::Index t = 0; t < data.size(); ++t) {
            filter.measure(data.y(0, t));
            out.e(0, t) = filter.innovation;
            out.Sigma.push_back(Eigen::MatrixXd::Constant(1, 1, filter.innovation_variance));
          }
          return out;
        });
    for (const EstimatedParameter& p : estimate.parameters) {
      std::printf("%s = %.1f +- %.1f\n", p.name.c_str(), p.value, p.se);
    }
    return exit_code(estimate, false);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  }
}
