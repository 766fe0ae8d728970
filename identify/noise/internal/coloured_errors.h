// How uncertain is what a simulation was fitted with, whose errors are not white?
#pragma once

#include <vector>

#include <Eigen/Core>

#include "identify/model/model.h"
#include "lib/data/dataset.h"

namespace identikal {

/// Gradients of the samples' log-likelihoods by the free entries, of a simulation whose errors are
/// N(0, R):
///
///   s_t = sum_j -e_tj/R_j de_tj/dtheta + (e_tj^2/R_j - 1)/(2 R_j) dR_j/dtheta
///
/// @return entries x samples of all recordings; empty where there is no simulation
Eigen::MatrixXd simulation_scores(const Model& model, const std::vector<Dataset>& recordings,
                                  const ParameterSet& at);

struct ColouredCovariance {
  Eigen::MatrixXd covariance;
  Eigen::Index bandwidth = 1;  ///< samples over which errors are taken as correlated
  double freedom = 0.0;        ///< of Student's t that goes with it: it is itself an estimate
};

/// white S white with S the long-run covariance of the scores; no variance below that of `white`
/// (identify/vehicle/covariance.h has the same for vehicles).
/// @param white   inverse of the information
/// @param scores  as many rows as `white`
ColouredCovariance coloured_covariance(const Eigen::MatrixXd& white, const Eigen::MatrixXd& scores);

}  // namespace identikal
