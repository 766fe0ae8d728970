// Example 1 of Matisko (2013), section 3.4: its true noise, the two wrong tunings of its table 1,
// and innovations of the filters that these make.
#pragma once

#include <Eigen/Core>

#include "lib/base/random.h"
#include "lib/filter/kalman.h"
#include "lib/filter/simulation.h"
#include "lib/model/state_space.h"

namespace identikal {

/// (3.32) with the true noise (3.33).
inline StateSpace matisko_example_1() {
  using Eigen::MatrixXd;
  StateSpace m;
  m.A = (MatrixXd(3, 3) << 0.5, 1, 0.2, 0, -0.5, 0.2, 0, 0, 0.97).finished();
  m.G = (MatrixXd(3, 2) << 1, 0.2, 0, 1, 1, 0).finished();
  m.C = (MatrixXd(1, 3) << 1, 0, 0).finished();
  m.B.resize(3, 0);
  m.D.resize(1, 0);
  m.Q = (MatrixXd(2, 2) << 10, -0.5, -0.5, 1).finished();
  m.R = MatrixXd::Ones(1, 1);
  m.S = MatrixXd::Zero(2, 1);
  return m;
}

/// The filters of table 1: 0 optimal, 1 Q = 4 I, 2 Q = Q_1 and R = 2.
inline StateSpace matisko_example_1_tuning(int number) {
  StateSpace m = matisko_example_1();
  if (number == 1) m.Q = 4.0 * Eigen::MatrixXd::Identity(2, 2);
  if (number == 2) {
    m.Q = Eigen::Vector2d(6, 4).asDiagonal();
    m.R *= 2.0;
  }
  return m;
}

/// Innovations of that filter on a new recording, ny x samples.
inline Eigen::MatrixXd matisko_example_1_innovations(int tuning, Eigen::Index samples,
                                                     Random& random) {
  const Eigen::MatrixXd u(0, samples);
  const Eigen::MatrixXd y =
      simulate_outputs(matisko_example_1(), InitialState::stationary, {}, samples, random);
  return kalman_filter(matisko_example_1_tuning(tuning), InitialState::stationary, y, u,
                       Keep::innovations)
      .e;
}

}  // namespace identikal
