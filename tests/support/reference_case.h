// A simulated tracker with references of its positions; its sensors' errors may last.
#pragma once

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "identify/model/model.h"
#include "identify/model/model_file.h"
#include "lib/base/random.h"
#include "lib/filter/simulation.h"
#include "lib/model/linear_model.h"

namespace identikal {

struct ReferenceCase {
  Model model;
  std::vector<Dataset> recordings;
};

inline std::string tracker_text() {
  return R"(identikal: 1
name: tracker
time: {kind: continuous, column: t, unit: s, step: 0.1 s}
parameters: {q: {value: 0.002 m^2/s^3, min: 0}, r: {value: 1 m^2, min: 0}}
states: {px: m, vx: m/s, py: m, vy: m/s}
dynamics: {px: vx, vx: 0, py: vy, vy: 0}
outputs: {zx: {column: zx, unit: m, equals: px}, zy: {column: zy, unit: m, equals: py}}
noise:
  process: {kind: density, variance: {vx: q, vy: q}}
  measurement: {variance: {zx: r, zy: r}}
initial: diffuse
reference: {px: {column: true_px, unit: m, sd: 0.02}, py: {column: true_py, unit: m}}
)";
}

/// @param lasting  variance [m^2] of a further error of the sensors, an autoregression of 2 s
inline ReferenceCase simulated_tracker(Eigen::Index rows, std::uint64_t seed, double lasting) {
  constexpr double kStep = 0.1, kLasts = 2.0;
  ReferenceCase out{parse_model_file(tracker_text(), "tracker.yaml"), {}};
  noise_model(out.model).dt = kStep;
  const LinearModel& linear = as_linear(out.model);
  Random random(seed);
  Eigen::MatrixXd states;
  Dataset data;
  data.name = "tracker.csv";
  data.dt = kStep;
  data.time = Eigen::VectorXd::LinSpaced(rows, 0.0, kStep * static_cast<double>(rows - 1));
  data.y = simulate_outputs(instantiate(linear, out.model.parameters), InitialState::diffuse, {},
                            rows, random, &states);
  data.u.resize(0, rows);
  data.outputs = {{"zx", "m"}, {"zy", "m"}};
  data.reference.resize(2, rows);
  const double keep = std::exp(-kStep / kLasts);
  Eigen::Vector2d error = Eigen::Vector2d::Zero();
  for (Eigen::Index t = 0; t < rows; ++t) {
    error = keep * error + std::sqrt(lasting * (1.0 - keep * keep)) *
                               Eigen::Vector2d(random.normal(), random.normal());
    data.y.col(t) += error;
    const bool missing = t % 3 == 1;
    data.reference(0, t) =
        missing ? std::numeric_limits<double>::quiet_NaN() : states(0, t) + 0.02 * random.normal();
    data.reference(1, t) = states(2, t);
  }
  out.recordings.push_back(std::move(data));
  return out;
}

}  // namespace identikal
