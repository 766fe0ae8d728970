// Which matrices and first states make a simulation follow recordings best?
#pragma once

#include <vector>

#include <Eigen/Core>

#include "lib/subspace/innovation_form.h"

namespace identikal {

/// The model with those B and D that minimise the sum of squares of y less its simulation, each recording
/// from a first state of its own: linear least squares, for given A and C. K and sigma stay. Outputs count by
/// the square of their unit: scale them. Missing outputs do not count.
///
/// Example:
///
///     const InnovationForm simulator = with_inputs_by_simulation(states.model(4), {y}, {u});
///
/// @param y  of every recording p x N, NaN = missing
/// @param u  of every recording m x N, nothing missing
/// @throws std::invalid_argument for a model without inputs, or recordings of other shapes
InnovationForm with_inputs_by_simulation(InnovationForm model,
                                         const std::vector<Eigen::MatrixXd>& y,
                                         const std::vector<Eigen::MatrixXd>& u);

/// Theta = [vec A; vec B; vec C; vec D], columns one after the other.
Eigen::VectorXd simulation_parameters(const InnovationForm& model);
/// The model of these parameters; K and sigma stay.
InnovationForm with_simulation_parameters(InnovationForm model, const Eigen::VectorXd& theta);
/// Orthonormal directions of theta that are no change of basis, as local_coordinates() has them for predictions.
Eigen::MatrixXd simulation_coordinates(const InnovationForm& model);

/// All matrices of a simulation as a problem of least squares (output error): r = y - (C x + D u), x(t+1) = A x + B u, each
/// recording from the first state that is best for it. That state is eliminated (variable projection with the derivative of
/// Kaufman 1975, A variable projection method for solving separable nonlinear least squares problems, BIT 15).
///
/// Example:
///
///     const SimulationErrorProblem errors({y}, {u});
///     const InnovationForm second_order = states.model(2);
///     Eigen::VectorXd r;
///     Eigen::MatrixXd J;  // along every direction
///     errors.evaluate(second_order, simulation_coordinates(second_order), r, &J);
class SimulationErrorProblem {
 public:
  /// @param y  of every recording p x N, NaN = missing: no residual
  /// @param u  of every recording m x N, nothing missing
  /// @throws std::invalid_argument for no recording, or numbers of rows that differ
  SimulationErrorProblem(const std::vector<Eigen::MatrixXd>& y,
                         const std::vector<Eigen::MatrixXd>& u);
  Eigen::Index residuals() const { return residuals_; }
  /// @param directions  of theta, theta x d; @param J  residuals() x d, dr along them, where it is asked for
  /// @return false where the simulation overflows
  bool evaluate(const InnovationForm& model, const Eigen::MatrixXd& directions, Eigen::VectorXd& r,
                Eigen::MatrixXd* J) const;

 private:
  std::vector<Eigen::MatrixXd> y_, u_;
  Eigen::Index residuals_ = 0;
};

}  // namespace identikal
