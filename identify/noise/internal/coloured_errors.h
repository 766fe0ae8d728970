// How uncertain is what a simulation was fitted with, whose errors are not white?
#pragma once

#include <vector>

#include <Eigen/Core>

#include "identify/model/model.h"
#include "lib/data/dataset.h"

namespace identikal {

/// How the score of a simulation scatters whose errors e are N(0, R) to the likelihood, and coloured.
struct SimulationScore {
  /// Gradients of the samples' log-likelihoods by the free entries, entries x samples:
  ///   s_t = sum_j -e_tj/R_j de_tj/dtheta + (e_tj^2/R_j - 1)/(2 R_j) dR_j/dtheta
  /// Empty where there is no simulation.
  Eigen::MatrixXd by_sample;
  /// Covariance of their sum where e follows the autoregression of its own samples:
  ///   sum_(s,t) M_s' E(e_s e_t') M_t,  M_t = R^-1 de_t/dtheta
  /// entries x entries; zero for what moves no output.
  Eigen::MatrixXd by_autoregression;
};
SimulationScore simulation_score(const Model& model, const std::vector<Dataset>& recordings,
                                 const ParameterSet& at);

struct ColouredCovariance {
  Eigen::MatrixXd covariance;
  Eigen::Index bandwidth = 1;  ///< samples over which errors are taken as correlated
  double freedom = 0.0;        ///< of Student's t that goes with it: it is itself an estimate
};

/// white S white with S the long-run covariance of the scores, widened to no variance below that by
/// the autoregression, nor below that of `white`.
/// @param white  inverse of the information
/// @param by     the entries' derivatives by what `white` is of
ColouredCovariance coloured_covariance(const Eigen::MatrixXd& white, const SimulationScore& score,
                                       const Eigen::MatrixXd& by);

}  // namespace identikal
