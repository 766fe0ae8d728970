// Steps that every sampler of weighted draws takes. Internal to solvers.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "lib/base/random.h"

namespace identikal {

/// Weights of a rise of the temperature by `step`, largest 1; -infinity weighs nothing.
Eigen::VectorXd tempered_weights(const Eigen::VectorXd& log_likelihood, double step);
/// The same into `out`, whose memory is used again.
void tempered_weights(const Eigen::VectorXd& log_likelihood, double step, Eigen::VectorXd& out);

/// (sum w)^2 / (n sum w^2)
double effective_share(const Eigen::VectorXd& w);

/// The largest rise of the temperature that leaves half of the draws effective, or what is `left`.
double next_step(const Eigen::VectorXd& log_likelihood, double left);

/// Positions of n draws by systematic resampling.
std::vector<Eigen::Index> resampled(const Eigen::VectorXd& w, Random& random);

/// A factor of the covariance of equally likely draws; directions in which all agree get a little.
Eigen::MatrixXd spread(const Eigen::MatrixXd& draws);

}  // namespace identikal
