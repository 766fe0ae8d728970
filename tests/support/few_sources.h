// A system whose process noise comes from fewer sources than it has states.
#pragma once

#include <cmath>

#include <Eigen/Core>
#include <Eigen/Eigenvalues>

#include "lib/base/random.h"
#include "tests/support/matisko_systems.h"
#include "tests/support/random_model.h"

namespace identikal {

/// n states, all measured, moved by `rank` independent noises through unknown vectors: Q = g g', a
/// full matrix, of trace 4 rank.
inline MatiskoSystem few_sources(Eigen::Index n, Eigen::Index rank, std::uint64_t seed) {
  MatiskoSystem out;
  Random random(seed);
  LinearModel& m = as_linear(out.model);
  out.model.name = "few sources";
  out.samples = 2000;
  m.A.constant = random_matrix(random, n, n);
  m.A.constant *= 0.8 / m.A.constant.eigenvalues().cwiseAbs().maxCoeff();
  m.G.constant = m.C.constant = Eigen::MatrixXd::Identity(n, n);
  complete(out, Eigen::VectorXd::Ones(n), Eigen::VectorXd::Ones(n));
  out.model.parameters[0].domain = Domain::positive_definite;
  Eigen::MatrixXd g = random_matrix(random, n, rank);
  g *= 2.0 / std::sqrt(g.squaredNorm() / static_cast<double>(rank));
  Parameter Q = out.model.parameters[0], R = out.model.parameters[1];
  Q.value = g * g.transpose();
  out.truth = free_entries({Q, R});
  return out;
}

}  // namespace identikal
