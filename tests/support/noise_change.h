// A recording whose noise changes on the way.
#pragma once

#include <cstdint>

#include <Eigen/Core>

#include "identify/model/model_file.h"
#include "lib/base/random.h"
#include "lib/data/dataset.h"
#include "tests/support/matisko_systems.h"
#include "tests/support/scalar_case.h"

namespace identikal {

struct NoiseChangeCase {
  Model model;            ///< starts at the values before the change
  Eigen::VectorXd after;  ///< free entries after it
  Dataset data;
};

/// `before` samples with the system's true noise, then `behind` with one entry `factor` times that.
inline NoiseChangeCase system_with_change(const MatiskoSystem& system, Eigen::Index entry,
                                          double factor, Eigen::Index before, Eigen::Index behind,
                                          std::uint64_t seed) {
  NoiseChangeCase out;
  out.model = system.model;
  out.model.parameters = with_entries(out.model.parameters, system.truth);
  out.after = system.truth;
  out.after[entry] *= factor;
  Random random(seed);
  StateSpace m = true_system(system);
  const Eigen::MatrixXd P = *solve_discrete_lyapunov(m.A, m.G * m.Q * m.G.transpose());
  Eigen::VectorXd x = semidefinite_factor(P) * random.normal(m.states());
  Eigen::MatrixXd y(m.outputs(), before + behind);
  for (Eigen::Index t = 0; t < y.cols(); ++t) {
    if (t == before) {
      m = instantiate(as_linear(out.model), with_entries(out.model.parameters, out.after));
    }
    y.col(t) = m.C * x + semidefinite_factor(m.R) * random.normal(m.outputs());
    x = (m.A * x + m.G * semidefinite_factor(m.Q) * random.normal(m.Q.rows())).eval();
  }
  out.data = dataset_of(y);
  return out;
}

}  // namespace identikal
