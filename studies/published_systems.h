// Which systems do the source's experiments run on?
#pragma once

#include <Eigen/Core>

#include "identify/model/model_file.h"
#include "lib/base/random.h"
#include "lib/data/dataset.h"
#include "lib/model/shaping_filter.h"
#include "lib/model/state_space.h"

namespace identikal {

/// x+ = A x + G w, y = C x + v.
struct PublishedSystem {
  Eigen::MatrixXd A, G, C;
};

/// System 1 to 7 of Matisko (2013), sections 4.5.1 and 4.7. @throws std::invalid_argument else
PublishedSystem published_system(int number);

/// The system with Q and R free and diagonal, started at q0 and r0 times identity.
Model model_of(const PublishedSystem& system, double q0, double r0);

/// The model with these variances, Q's first.
Model with_variances(Model model, const Eigen::VectorXd& variances);

/// (5.17), and (5.21) with its zero at -8 moved inside the unit circle, which leaves the spectrum's
/// shape.
PublishedSystem oscillating_system();
ShapingFilter oscillating_noise_filter();

/// (5.26): w of variance 0.001 through a damped sine of 46 samples, v of variance 0.05; x0 = 0.
StateSpace system_with_damped_sine_noise();

/// The part of (5.26) behind its noise filter, poles at 1 and 0.94, Q and R as model_of(), diffuse.
Model model_without_noise_filter();

/// A recording of the system, without inputs.
/// @param states  receives x(1) ... x(samples) as columns, when not nullptr
Dataset recording(const StateSpace& system, InitialState initial, Eigen::Index samples,
                  Random& random, Eigen::MatrixXd* states = nullptr);

/// A recording of the model at its own values.
Dataset recording(const Model& model, Eigen::Index samples, Random& random);

}  // namespace identikal
