// Output error of the vehicle: simulated minus measured, with exact derivatives, and its maximum
// likelihood.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "identify/vehicle/unknowns.h"
#include "identify/vehicle/usable_data.h"
#include "lib/vehicle/motion.h"
#include "lib/vehicle/sensor.h"
#include "solvers/problem.h"

namespace identikal {

/// The least squares problem. Its coordinates are the free parameters over their scale, with
/// `prediction` the gain, then (vy, r) over kStateScale at the begin of every segment. Residuals
/// are ordered by row, then output; missing samples have none.
///
/// Output error simulates: there is measurement noise only. With `prediction` the residuals are the
/// innovations of a filter with a constant gain K (2 x outputs),
///   e = y - yhat(x),  x <- x + K e  at every row, then on to the next,
/// as of the steady Kalman filter of a car with process noise (side wind, road, unmodelled forces;
/// Ljung 1999, section 7.3): their likelihood is that of the recording with the process noise whose
/// filter has this gain. Coordinates of the gain are K diag(scale of the outputs).
struct VehicleProblem {
  const VehicleRun* run = nullptr;
  VehicleUnknowns unknowns;
  bool robust = false;  ///< noise of Student's distribution, which allows for outliers; else normal
  bool late_sensors = false;     ///< has_late_sensor()
  bool prediction = false;       ///< one-step prediction with a free filter gain; else simulation
  Eigen::VectorXd output_scale;  ///< typical size of every output's error, for the gain
  std::vector<DrivenSegment> driven;
  std::vector<Eigen::Index> row, output;  ///< of every residual
  Eigen::VectorXd sample;                 ///< measured value of every residual
  Eigen::VectorXd lower, upper;           ///< of the coordinates
  IntegrationDemand demand;               ///< what the integration steps were made for

  Eigen::Index parameters() const { return static_cast<Eigen::Index>(unknowns.free.size()); }
  /// Coordinates of the gain, K column by column; they follow the parameters.
  Eigen::Index gains() const { return prediction ? 2 * run->y.rows() : 0; }
  /// Where the initial state of segment s stands among the coordinates.
  Eigen::Index state_of(std::size_t s) const {
    return parameters() + gains() + 2 * static_cast<Eigen::Index>(s);
  }
  Eigen::Index coordinates() const { return lower.size(); }
  Eigen::Index residuals() const { return sample.size(); }
};

inline const Eigen::Vector2d kStateScale(1.0, 0.2);  ///< m/s, rad/s

/// Whether the sensor of some output has a lag or a delay, or may get one.
bool has_late_sensor(const VehicleRun& run, const VehicleUnknowns& unknowns);

/// The simulation of a run as residuals: every output of every usable row, the parameters and
/// initial states of `unknowns` scaled to coordinates. Samples at the ends of a segment that show
/// what was before or behind it have none: those within a known delay of their sensor, or, of one
/// that is free, within its bounds and 0.1 s.
VehicleProblem make_vehicle_problem(const VehicleRun& run, const VehicleUnknowns& unknowns,
                                    const IntegrationDemand& demand);

/// The same with one-step prediction, and the coordinates of `z`, of the simulation, there: no
/// gain.
/// @param sd  of the outputs' errors
VehicleProblem predicting(const VehicleProblem& problem, const Eigen::VectorXd& sd,
                          Eigen::VectorXd& z);

/// Whether a free parameter lies at one of its bounds.
bool is_at_bound(const VehicleProblem& problem, const Eigen::VectorXd& z, Eigen::Index parameter);

/// All parameters at these coordinates, which need not lie within the bounds.
VehicleParameters<double> parameters_at(const VehicleProblem& problem, const Eigen::VectorXd& z);

/// Coordinates of these parameters, clipped to the bounds, and of initial states: measured by the
/// first samples, or those of steady driving where vy or r is not measured.
Eigen::VectorXd coordinates_of(const VehicleProblem& problem, const VehicleParameters<double>& p);

/// Simulated (predicted) minus measured, SI, and when `J` is not null its Jacobian: a column for
/// each of the parameters and gains, then two for the initial state of the row's own segment, on which no
/// other segment's rows depend. false when the simulation diverges.
bool output_error(const VehicleProblem& problem, const Eigen::VectorXd& z, Eigen::VectorXd& e,
                  LeastSquares::RowMatrix* J);

/// The segments with the steering read at these parameters' delay and lag; empty where these are known, and
/// VehicleProblem::driven has it.
std::vector<DrivenSegment> moved_by_delay(const VehicleProblem& problem,
                                          const VehicleParameters<double>& p);

/// What each output of the run reads off that car.
std::vector<VehicleReading> readings(const VehicleRun& run, const SingleTrack<>& car);

/// What the outputs show at every row (outputs x rows of the run; NaN outside of segments), of
/// sensors with lag and delay.
Eigen::MatrixXd late_outputs(const VehicleProblem& problem, const Eigen::VectorXd& z);

/// Motion of the simulated car at every row of the segments, without gain: calls observe(row,
/// motion, vx).
template <typename Observe>
void replay(const VehicleProblem& problem, const Eigen::VectorXd& z, Observe&& observe) {
  const VehicleParameters<double> p = parameters_at(problem, z);
  const std::vector<DrivenSegment> moved = moved_by_delay(problem, p);
  const std::vector<DrivenSegment>& driven = moved.empty() ? problem.driven : moved;
  const SingleTrack<> car = car_with(problem.unknowns.curve, p);
  for (std::size_t s = 0; s < driven.size(); ++s) {
    const Eigen::Index at = problem.state_of(s);
    const Eigen::Index first = problem.run->segments[s].first;
    const auto shifted = [&](Eigen::Index k, const Motion& motion, double vx) {
      observe(first + k, motion, vx);
    };
    const double vy = z[at] * kStateScale[0], r = z[at + 1] * kStateScale[1];
    simulate(car, driven[s], vy, r, shifted);
  }
}

/// What the sensors would have measured without noise, and the motion behind it: calls
/// observe(row, motion, vx, values) with one value per output of the run, SI.
template <typename Observe>
void replay_outputs(const VehicleProblem& problem, const Eigen::VectorXd& z, Observe&& observe) {
  const std::vector<VehicleReading> sensors =
      readings(*problem.run, car_with(problem.unknowns.curve, parameters_at(problem, z)));
  Eigen::VectorXd values(problem.run->y.rows());
  Eigen::MatrixXd late;
  if (problem.late_sensors) late = late_outputs(problem, z);
  replay(problem, z, [&](Eigen::Index t, const Motion& motion, double vx) {
    for (Eigen::Index j = 0; j < values.size(); ++j) {
      values[j] = late.size() > 0 ? late(j, t) : sensors[j].value(motion, vx);
    }
    observe(t, motion, vx, values);
  });
}

/// Root mean square of the errors of each output, weighted by error_weights().
Eigen::VectorXd rms_per_output(const VehicleProblem& problem, const Eigen::VectorXd& e);

/// Standard deviations of the noise: the given ones, else the most likely for these errors (normal
/// noise: their root mean square), but no less than 1e-7 of the output's largest value, below which
/// only rounding and integration errors are left.
Eigen::VectorXd noise_sd(const VehicleProblem& problem, const Eigen::VectorXd& e);

/// Log-likelihood with these standard deviations per output, priors included up to a constant.
/// @param z  coordinates at which the errors were computed
double log_likelihood(const VehicleProblem& problem, const Eigen::VectorXd& z,
                      const Eigen::VectorXd& e, const Eigen::VectorXd& sd);

/// The prior of a free parameter as a residual of unit variance, r(z), and its derivative; {0, 0}
/// where there is none. Uniform and log-uniform priors are bounds only.
struct PriorResidual {
  double value = 0.0, slope = 0.0;
};
PriorResidual prior_residual(const VehicleProblem& problem, const Eigen::VectorXd& z,
                             Eigen::Index parameter);

/// Constraints between parameters at z as residuals (lib/model/constraints.h), with slopes by the
/// coordinates of the parameters; no rows without constraints or multipliers.
ConstraintResiduals constraint_rows(const VehicleProblem& problem, const Multipliers& multipliers,
                                    const Eigen::VectorXd& z);

/// A maximum of the likelihood over parameters, initial states and noise.
struct VehicleOptimum {
  Eigen::VectorXd z;
  Eigen::VectorXd sd;  ///< per output, root mean square (or given)
  double log_likelihood = -std::numeric_limits<double>::infinity();
  bool converged = false;
  std::string message;
  int iterations = 0;
  int evaluations = 0;
  std::vector<double> path;  ///< log-likelihood at the start and after every iteration
  Multipliers multipliers;   ///< of the constraints, if any
};

/// The maximum of the likelihood with every output's noise at its most likely size (unless given):
/// Gauss-Newton steps whose weights follow the noise (solvers/scoring.h), in the parameters and
/// gains, with every segment's initial state at its best for them, so that time is linear in the segments.
///
/// Example:
///
///     const VehicleRun run = usable_run(car, recordings);
///     const VehicleUnknowns theta = vehicle_unknowns(car);
///     const auto problem = make_vehicle_problem(run, theta, demand_of(theta, theta.value));
///     const auto best = maximise_likelihood(problem, coordinates_of(problem, theta.value), {});
VehicleOptimum maximise_likelihood(const VehicleProblem& problem, const Eigen::VectorXd& start,
                                   const SolverOptions& options);

}  // namespace identikal
