// Output error of the vehicle: simulated minus measured, with exact derivatives, and its maximum
// likelihood.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "identify/vehicle_run.h"
#include "lib/parameter.h"
#include "lib/single_track.h"
#include "solvers/problem.h"

namespace identikal {

/// What is unknown about the car, in SI.
struct VehicleUnknowns {
  VehicleParameters<double> value;     ///< fixed values; of free ones the file's start
  std::vector<VehicleParameter> free;  ///< in the order of the model file
  std::vector<std::size_t> position;   ///< of each free one in the ParameterSet
  Eigen::VectorXd lower, upper;        ///< bounds of the free ones
  Eigen::VectorXd scale;               ///< typical size of the free ones, for the optimiser
};

/// Mass, lengths, inertia, stiffnesses, steering ratio.
bool must_be_positive(VehicleParameter parameter);

/// Reads the parameters of the model file; what it does not name is neutral (neutral_vehicle()).
/// @throws InputError for a name that the vehicle does not have, a needed one that is missing, or a
/// mass,
///   length, inertia, stiffness or steering ratio that is not positive
VehicleUnknowns vehicle_unknowns(const ModelFile& model);

/// Axle loads at standstill [N], front and rear.
Eigen::Vector2d axle_loads(const VehicleParameters<double>& p);

/// The least squares problem. Its coordinates are the free parameters over their scale, then (vy,
/// r) over kStateScale at the begin of every stretch. Residuals are ordered by row, then output;
/// missing samples have none.
struct VehicleProblem {
  const VehicleRun* run = nullptr;
  VehicleUnknowns unknowns;
  bool softening = false;  ///< tyre forces saturate; else the axles are linear
  std::vector<DrivenStretch> driven;
  std::vector<Eigen::Index> row, output;  ///< of every residual
  Eigen::VectorXd sample;                 ///< measured value of every residual
  Eigen::VectorXd lower, upper;           ///< of the coordinates
  double decay_rate = 0.0;                ///< what the integration steps were made for

  Eigen::Index parameters() const { return static_cast<Eigen::Index>(unknowns.free.size()); }
  Eigen::Index coordinates() const { return lower.size(); }
  Eigen::Index residuals() const { return sample.size(); }
};

inline const Eigen::Vector2d kStateScale(1.0, 0.2);  ///< m/s, rad/s

/// @param decay_rate  decay_rate_times_speed() that the integration steps are chosen for
VehicleProblem make_vehicle_problem(const VehicleRun& run, const VehicleUnknowns& unknowns,
                                    bool softening, double decay_rate);

/// All parameters at these coordinates, clipped to nothing.
VehicleParameters<double> parameters_at(const VehicleProblem& problem, const Eigen::VectorXd& z);

/// Coordinates that stand for these parameters (clipped to the bounds) and for initial states read
/// off the first samples, or taken as steady where vy or r is not measured.
Eigen::VectorXd coordinates_of(const VehicleProblem& problem, const VehicleParameters<double>& p);

/// Simulated minus measured, SI, and when `J` is not null its derivative by the coordinates.
/// false when the car runs away.
bool output_error(const VehicleProblem& problem, const Eigen::VectorXd& z, Eigen::VectorXd& e,
                  LeastSquares::RowMatrix* J);

/// Motion of the car at every row of the stretches: calls observe(row, motion, vx).
template <typename Observe>
void replay(const VehicleProblem& problem, const Eigen::VectorXd& z, Observe&& observe) {
  const VehicleParameters<double> p = parameters_at(problem, z);
  for (std::size_t s = 0; s < problem.driven.size(); ++s) {
    const Eigen::Index at = problem.parameters() + 2 * static_cast<Eigen::Index>(s);
    const Eigen::Index first = problem.run->stretches[s].first;
    const auto shifted = [&](Eigen::Index k, const Motion<double>& motion, double vx) {
      observe(first + k, motion, vx);
    };
    const double vy = z[at] * kStateScale[0], r = z[at + 1] * kStateScale[1];
    if (problem.softening) {
      simulate(softening_car(p), problem.driven[s], vy, r, shifted);
    } else {
      simulate(linear_car(p), problem.driven[s], vy, r, shifted);
    }
  }
}

/// Root mean square of the errors of each output.
Eigen::VectorXd rms_per_output(const VehicleProblem& problem, const Eigen::VectorXd& e);

/// Standard deviations to weigh with: the given ones, else the root mean square of the errors, but
/// no less than 1e-7 of the output's largest value, below which only rounding and integration
/// errors are left.
Eigen::VectorXd noise_sd(const VehicleProblem& problem, const Eigen::VectorXd& e);

/// Gaussian log-likelihood with these standard deviations per output.
double log_likelihood(const VehicleProblem& problem, const Eigen::VectorXd& e,
                      const Eigen::VectorXd& sd);

/// A maximum of the likelihood over parameters, initial states and noise.
struct VehicleOptimum {
  Eigen::VectorXd z;
  Eigen::VectorXd sd;  ///< per output, root mean square (or given)
  double log_likelihood = -std::numeric_limits<double>::infinity();
  bool converged = false;
  std::string message;
  int iterations = 0;
  int evaluations = 0;
};

/// Least squares with fixed weights and re-estimation of the noise in turn, until neither moves:
/// this climbs the likelihood to its maximum for white noise of unknown size.
VehicleOptimum maximise_likelihood(const VehicleProblem& problem, const Eigen::VectorXd& start,
                                   const SolverOptions& options);

}  // namespace identikal
