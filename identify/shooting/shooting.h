// From where is a simulation that follows recordings found? Quickly from many places, and by
// trajectories that follow them anyway.
#pragma once

#include <functional>
#include <limits>
#include <vector>

#include "identify/model/model.h"
#include "lib/data/dataset.h"

namespace identikal {

struct ShootingOptions {
  int threads = 1;  ///< starts at a time; 0: as many as there are cores
  /// Called between the steps of a start, from 0, with its iterations and its lowest loss so far, by
  /// one thread at a time; return false to end with what there is. Empty: none.
  std::function<bool(int start, int iterations, double loss)> progress;
};

/// One stage of a path of multiple shooting: how free the states were, and what errors that left.
struct ShootingStage {
  double freedom =
      0.0;  ///< by what part of its range disturbances would drive a state over a recording
  double rms = 0.0;        ///< of the outputs' errors, as a part of their standard deviation
  double simulated = 0.0;  ///< the same of a simulation from there; infinite where it diverges
};

/// Where a start has led.
struct ShootingEnd {
  ParameterSet parameters;
  /// sum over outputs of n/2 log(mean square error) of the simulation, or where their noise is known half
  /// the sum of squared errors over its variance: what the log-likelihood lacks; infinite where
  /// there is no simulation that stays finite.
  double loss = std::numeric_limits<double>::infinity();
  bool converged = false;  ///< no step from there lowers the squares
  int same_as = 0;         ///< the first start that has led to the same place, from 0; or itself
  std::vector<ShootingStage> stages;  ///< of the path; empty: simulations alone led here
  bool by_parts = false;              ///< growing parts of the recordings led here
  int iterations = 0, evaluations = 0;
};

/// May trajectories be followed? Only of formulas that no Kalman filter takes, without process
/// noise, from a start without variance, and where a free parameter moves a state.
bool allows_multiple_shooting(const Model& model, const std::vector<Dataset>& recordings);

/// Standard deviations of the outputs of such a model, SI, where none of them is unknown; else empty.
///
/// Example:
///
///     if (known_output_sd(model).size() > 0) std::puts("the noise is known");
Eigen::VectorXd known_output_sd(const Model& model);

/// Looks for the least squares of a simulation, from several starts, on steps of integration that
/// are as fine as a search needs (1e-4 of a state's range), by Levenberg-Marquardt: a few steps
/// from the best eight of every start's candidates, again from the better half, until one is left. Where
/// fewer than 80 % of the starts come to the same place, the others take the path of multiple
/// shooting: the states of all samples are unknowns beside the parameters, and what the motion
/// makes of one need not be the next. Where they are free enough to follow the outputs, errors do
/// not pile up along the recording, and that problem is nearly quadratic
/// (internal/trajectory_problem.h). The freedom is then taken from them step by step, from
/// prediction to simulation, each from where the last has ended, until a simulation does as well.
/// Where that is not enough either, from the first eighth, quarter and half of each recording:
/// phases of an oscillation whose frequency is off run apart over a long one, not over its
/// beginning.
/// Source: Bock (1983), "Recent advances in parameter identification techniques for O.D.E.";
/// Voss, Timmer & Kurths (2004), "Nonlinear dynamical system identification from uncertain and
/// indirect measurements".
///
/// Example:
///
///     const std::vector<ShootingEnd> ends = shoot(model, recordings, {{model.parameters}});
///     if (ends[0].converged) model.parameters = ends[0].parameters;
///
/// @param candidates  per start: sets of the model's parameters, inside their bounds; the first of
///   them begins the path
/// @throws std::invalid_argument where allows_multiple_shooting() is false, or without candidates
std::vector<ShootingEnd> shoot(const Model& model, const std::vector<Dataset>& recordings,
                               const std::vector<std::vector<ParameterSet>>& candidates,
                               const ShootingOptions& options = {});

}  // namespace identikal
