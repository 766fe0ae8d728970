// Models and recordings drawn at random.
#pragma once

#include <Eigen/Core>
#include <Eigen/Eigenvalues>

#include "lib/base/random.h"
#include "lib/model/state_space.h"

namespace identikal {

inline Eigen::MatrixXd random_matrix(Random& random, Eigen::Index rows, Eigen::Index cols) {
  Eigen::MatrixXd M(rows, cols);
  for (Eigen::Index j = 0; j < cols; ++j) M.col(j) = random.normal(rows);
  return M;
}

// m + by d.
inline StateSpace moved(StateSpace m, const StateSpace& d, double by) {
  m.A += by * d.A, m.B += by * d.B, m.C += by * d.C, m.D += by * d.D, m.G += by * d.G;
  m.Q += by * d.Q, m.R += by * d.R, m.S += by * d.S, m.x0 += by * d.x0, m.P0 += by * d.P0;
  return m;
}

// A stable random model with inputs, feed-through and cross-covariance.
inline StateSpace random_model(Random& random, Eigen::Index n, Eigen::Index nu, Eigen::Index ny,
                               Eigen::Index nw) {
  StateSpace m;
  m.A = random_matrix(random, n, n);
  m.A *= 0.9 / m.A.eigenvalues().cwiseAbs().maxCoeff();
  m.B = random_matrix(random, n, nu);
  m.C = random_matrix(random, ny, n);
  m.D = random_matrix(random, ny, nu);
  m.G = random_matrix(random, n, nw);
  const Eigen::MatrixXd L = random_matrix(random, nw + ny, nw + ny);
  const Eigen::MatrixXd joint =
      L * L.transpose() + 0.1 * Eigen::MatrixXd::Identity(nw + ny, nw + ny);
  m.Q = joint.topLeftCorner(nw, nw);
  m.S = joint.topRightCorner(nw, ny);
  m.R = joint.bottomRightCorner(ny, ny);
  m.x0 = random.normal(n);
  const Eigen::MatrixXd F = random_matrix(random, n, n);
  m.P0 = F * F.transpose();
  return m;
}

// A direction in which every matrix of the model changes; Q and R stay symmetric.
inline StateSpace random_direction(Random& random, const StateSpace& m) {
  const auto symmetric = [&](Eigen::Index n) {
    const Eigen::MatrixXd M = random_matrix(random, n, n);
    return Eigen::MatrixXd(M + M.transpose());
  };
  StateSpace d;
  d.A = random_matrix(random, m.states(), m.states());
  d.B = random_matrix(random, m.states(), m.inputs());
  d.C = random_matrix(random, m.outputs(), m.states());
  d.D = random_matrix(random, m.outputs(), m.inputs());
  d.G = random_matrix(random, m.states(), m.G.cols());
  d.Q = symmetric(m.Q.rows());
  d.R = symmetric(m.R.rows());
  d.S = random_matrix(random, m.S.rows(), m.S.cols());
  d.x0 = random.normal(m.states());
  d.P0 = symmetric(m.states());
  return d;
}

// A direction of the noise alone.
inline StateSpace noise_direction(Random& random, const StateSpace& m) {
  StateSpace d = random_direction(random, m);
  d.A.setZero();
  d.B.setZero();
  d.C.setZero();
  d.D.setZero();
  d.x0.setZero();
  d.P0.setZero();
  return d;
}

// A realisation of the model, started at x0.
inline Eigen::MatrixXd simulate_outputs(Random& random, const StateSpace& m,
                                        const Eigen::MatrixXd& u, Eigen::Index N) {
  const Eigen::Index nw = m.Q.rows(), ny = m.outputs();
  const Eigen::MatrixXd L = joint_covariance(m).llt().matrixL();
  Eigen::VectorXd x = m.x0;
  Eigen::MatrixXd y(ny, N);
  for (Eigen::Index t = 0; t < N; ++t) {
    const Eigen::VectorXd noise = L * random.normal(nw + ny);
    y.col(t) = m.C * x + noise.tail(ny);
    x = (m.A * x + m.G * noise.head(nw)).eval();
    if (m.inputs() > 0) {
      y.col(t) += m.D * u.col(t);
      x += m.B * u.col(t);
    }
  }
  return y;
}

}  // namespace identikal
