#include "identify/vehicle/series.h"

#include <cmath>

#include "identify/vehicle/driven_range.h"
#include "identify/vehicle/internal/robust_noise.h"
#include "lib/data/units.h"

namespace identikal {

Series vehicle_series(const VehicleProblem& problem, const Eigen::VectorXd& z) {
  const VehicleRun& run = *problem.run;
  Series series;
  series.time = run.time;
  series.measured = Eigen::MatrixXd::Constant(run.y.rows(), run.time.size(), kNone);
  series.predicted = series.measured;
  std::vector<Unit> units;
  for (const VehicleRun::Output& output : run.outputs) {
    units.push_back(unit_or_dimensionless(output.unit));
    series.channels.push_back(output.name);
    series.units.push_back(output.unit);
  }
  replay_outputs(problem, z,
                 [&](Eigen::Index t, const Motion&, double, const Eigen::VectorXd& values) {
                   for (Eigen::Index j = 0; j < values.size(); ++j) {
                     const Unit& unit = units[j];
                     series.predicted(j, t) = unit.from_si(values[j]);
                     series.measured(j, t) = unit.from_si(run.y(j, t));
                   }
                 });
  if (run.used_of.size() > 1) {
    for (const int recording : run.recording) series.recording.push_back(recording + 1);
  }
  return series;
}

std::vector<ChannelFit> channel_fits(const Series& series, bool robust) {
  std::vector<ChannelFit> out;
  for (std::size_t j = 0; j < series.channels.size(); ++j) {
    const auto row = static_cast<Eigen::Index>(j);
    std::vector<double> errors, values;
    for (Eigen::Index t = 0; t < series.time.size(); ++t) {
      const double measured = series.measured(row, t);
      if (std::isnan(measured)) continue;
      errors.push_back(series.predicted(row, t) - measured);
      values.push_back(measured);
    }
    const auto n = static_cast<Eigen::Index>(errors.size());
    const Eigen::Map<const Eigen::ArrayXd> e(errors.data(), n), y(values.data(), n);
    const Eigen::ArrayXd weight = error_weights(robust, e.matrix()).array();
    const double mean = (weight * y).sum() / weight.sum();
    ChannelFit fit;
    fit.channel = series.channels[j];
    fit.unit = series.units[j];
    fit.rmse = std::sqrt((weight * e.square()).sum() / weight.sum());
    fit.fit_percent =
        100.0 *
        (1.0 - std::sqrt((weight * e.square()).sum() / (weight * (y - mean).square()).sum()));
    out.push_back(fit);
  }
  return out;
}

KnownCar validate_vehicle(const Model& model, const std::vector<Dataset>& recordings,
                          const VehicleUnknowns& unknowns, const VehicleParameters<double>& p,
                          bool robust) {
  const VehicleRun run = usable_run(model, recordings);
  VehicleUnknowns known;
  known.value = p;
  known.curve = unknowns.curve;
  VehicleProblem problem = make_vehicle_problem(run, known, demand_of(known, p));
  problem.robust = robust;
  const VehicleOptimum states =
      maximise_likelihood(problem, coordinates_of(problem, p), SolverOptions{});
  return {vehicle_series(problem, states.z), driven_ranges(problem, states.z)};
}

}  // namespace identikal
