// Which systems do the source's experiments run on?
#pragma once

#include <Eigen/Core>

#include "identify/model_file.h"
#include "lib/dataset.h"
#include "lib/random.h"

namespace identikal {

/// x+ = A x + G w, y = C x + v.
struct PublishedSystem {
  Eigen::MatrixXd A, G, C;
};

/// System 1 to 7 of Matisko (2013), sections 4.5.1 and 4.7. @throws std::invalid_argument else
PublishedSystem published_system(int number);

/// The system with Q and R free and diagonal, started at q0 and r0 times identity.
ModelFile model_of(const PublishedSystem& system, double q0, double r0);

/// The model with these variances, Q's first.
ModelFile with_variances(ModelFile model, const Eigen::VectorXd& variances);

/// A recording of the model at its own values, from a stationary start.
Dataset recording(const ModelFile& model, Eigen::Index samples, Random& random);

}  // namespace identikal
