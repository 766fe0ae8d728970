// The linear stochastic model that every filter here works on.
#pragma once

#include <Eigen/Core>

#include "lib/base/alignment.h"

namespace identikal {

/// x(t+1) = A x + B u + G w,  y = C x + D u + v,  cov[w; v] = [Q S; S' R].
/// Shapes: A n x n, B n x nu, C ny x n, D ny x nu, G n x nw, Q nw x nw, R ny x ny, S nw x ny.
///
/// Example:
///
///     StateSpace level;  // x(t+1) = x + w, y = x + v
///     level.A = level.C = level.G = Eigen::MatrixXd::Identity(1, 1);
///     level.Q = Eigen::MatrixXd::Constant(1, 1, 1469.0), level.R = 10.0 * level.Q;
///     level.B = level.D = Eigen::MatrixXd(1, 0), level.S = Eigen::MatrixXd::Zero(1, 1);
///     check_shapes(level);
struct StateSpace {
  Eigen::MatrixXd A, B, C, D, G, Q, R, S;
  Eigen::VectorXd x0;  ///< n: mean of x(1) before the first measurement
  Eigen::MatrixXd P0;  ///< n x n: its covariance
  double dt = 1.0;     ///< sampling period [s]

  Eigen::Index states() const { return A.rows(); }
  Eigen::Index inputs() const { return B.cols(); }
  Eigen::Index outputs() const { return C.rows(); }
};

/// Throws std::invalid_argument, with the shapes in the message, unless the shapes agree.
void check_shapes(const StateSpace& model);

/// [Q S; S' R], the covariance of [w; v].
Eigen::MatrixXd joint_covariance(const StateSpace& model);

/// Of a derivative of a model: does A, B, C or D change?
bool changes_dynamics(const StateSpace& derivative);

/// Of a derivative of a model: does the start change by itself, and not as a steady state does with Q?
bool changes_start(const StateSpace& derivative);

/// Of a derivative of a model: does nothing but Q, R and S change, and the start with them?
bool changes_only_noise(const StateSpace& derivative);

}  // namespace identikal
