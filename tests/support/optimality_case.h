// A filter, and recordings of the system that it may or may not suit.
#pragma once

#include <string>

#include <Eigen/Core>

#include "identify/model/model_file.h"
#include "lib/base/random.h"
#include "lib/data/dataset.h"
#include "lib/filter/kalman.h"
#include "lib/filter/simulation.h"
#include "lib/model/state_space.h"

namespace identikal {

/// All matrices as numbers, nothing free.
inline Model fixed_model(const StateSpace& system) {
  Model out;
  out.source = "filter.yaml";
  as_linear(out) = constant_model(system, InitialState::stationary);
  for (Eigen::Index i = 0; i < system.outputs(); ++i) {
    ChannelSource source;
    source.name = source.column = "y" + std::to_string(i + 1);
    out.outputs.push_back(source);
  }
  return out;
}

inline Dataset recording_of(const StateSpace& truth, Eigen::Index samples, Random& random) {
  Dataset out;
  out.name = "simulated.csv";
  out.dt = 1.0;
  out.time = Eigen::VectorXd::LinSpaced(samples, 0.0, static_cast<double>(samples - 1));
  out.u.resize(truth.inputs(), samples);
  for (Eigen::Index t = 0; t < samples; ++t) out.u.col(t) = random.normal(truth.inputs());
  out.y = simulate_outputs(truth, InitialState::stationary, out.u, samples, random);
  for (Eigen::Index i = 0; i < truth.outputs(); ++i) {
    out.outputs.push_back({"y" + std::to_string(i + 1), ""});
  }
  for (Eigen::Index i = 0; i < truth.inputs(); ++i) {
    out.inputs.push_back({"u" + std::to_string(i + 1), ""});
  }
  return out;
}

inline FilterResult innovations_of(const Model& model, const Dataset& data) {
  return kalman_filter(instantiate(as_linear(model), model.parameters), as_linear(model).initial,
                       data.y, data.u, Keep::innovations);
}

}  // namespace identikal
