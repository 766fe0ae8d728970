// Where is a sum of squares least whose unknowns form a chain, and some of which all of it shares?
#pragma once

#include <functional>
#include <vector>

#include <Eigen/Core>

#include "solvers/problem.h"

namespace identikal {

/// Residuals that depend on this link's state, on the next one's, and on what is shared; m of them,
/// with their derivatives. The last link has no next one: those columns are not read.
struct ChainLink {
  Eigen::VectorXd residuals;                ///< m
  Eigen::MatrixXd by_state, by_next_state;  ///< m x state
  Eigen::MatrixXd by_shared;                ///< m x shared
};

/// minimise 1/2 sum_k ||r_k(s_k, s_(k+1), p)||^2 with lower <= p <= upper: states of a trajectory
/// and the parameters of its motion, or starts of many segments that have only these in common.
struct ChainedLeastSquares {
  Eigen::Index links = 0, state = 0, shared = 0;
  /// One link each, written; their derivatives where `with_derivatives`. false = undefined there,
  /// back off.
  std::function<bool(const Eigen::MatrixXd& states, const Eigen::VectorXd& shared,
                     bool with_derivatives, std::vector<ChainLink>& links)>
      evaluate;
  Eigen::VectorXd lower, upper;  ///< of p; +-infinity = free
};

struct ChainedSolution {
  Eigen::MatrixXd states;  ///< state x links
  Eigen::VectorXd shared;
  /// shared x shared, upper triangular: R'R is the information of p, the states being unknown.
  Eigen::MatrixXd root_information;
  SolverSummary summary;
};

/// Levenberg-Marquardt; a step costs as much as the chain has links. State after state is
/// eliminated by an orthogonal transformation of the rows that hold it (square-root information
/// form), so that no product of a long chain's transitions is ever made, and no square of a
/// derivative. Damping is in units of the largest derivative by each unknown so far. A shared
/// unknown that would leave its bounds goes to them, and the others to where that is best.
/// Where no state is free (state = 0) steps allow for the second derivative of the residuals along
/// them, by differences (geodesic acceleration): they follow narrow valleys that bend, and are shortened
/// where the bend asks for more than the step itself.
/// Of the options it knows max_iterations, function_tolerance (of the reduction still expected of
/// a whole step), parameter_tolerance (of p) and progress.
/// Source: Bierman (1977), "Factorization Methods for Discrete Sequential Estimation", chapter V;
/// Moré (1978); Nielsen (1999), "Damping parameter in Marquardt's method"; Transtrum & Sethna (2012),
/// "Improvements to the Levenberg-Marquardt algorithm for nonlinear least-squares minimization".
///
/// Example:
///
///     const ChainedSolution line = solve(ChainedLeastSquares{1, 1, 1, [](const auto& s,
///         const auto& p, bool, auto& r) {  // s = p and s + p = 4
///       return r[0] = {Eigen::Vector2d{s(0) - p[0], s(0) + p[0] - 4.0}, Eigen::Vector2d{1.0, 1.0},
///         {}, Eigen::Vector2d{-1.0, 1.0}}, true; }, Eigen::VectorXd{{-9.0}}, Eigen::VectorXd{{9.0}}},
///       Eigen::MatrixXd::Ones(1, 1), Eigen::VectorXd::Ones(1));
///
/// @param states  state x links, where to begin
/// @throws std::invalid_argument when sizes disagree or the start lies outside the bounds
ChainedSolution solve(const ChainedLeastSquares& problem, const Eigen::MatrixXd& states,
                      const Eigen::VectorXd& shared, const SolverOptions& options = {});

}  // namespace identikal
