// Where nothing is unknown but how large noises are, all of them growing by one factor s leave the
// gain and the innovations as they are, and every Sigma grows by s. So the derivatives by one
// parameter follow from those by the others (Euler's theorem on homogeneous functions), which spares
// the filter a lane. Internal to the filter.
//
//   [Q, R, S] = sum_i w_i d[Q, R, S]/dtheta_i  gives  sum_i w_i dSigma_i = Sigma,  sum_i w_i de_i = 0,
//   sum_i w_i g_i = 1/2 (sum_t e' Sigma^-1 e - values),
//   sum_i w_i I_ij = sum_t 1/2 tr(Sigma^-1 dSigma_j).
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "lib/filter/filter_result.h"

namespace identikal {

/// What a filter with a diffuse start has to say about a common factor of all noise.
struct FactorSums {
  double squares = 0.0;         ///< of standardised innovations, but for what the start explains
  Eigen::Index values = 0;      ///< measured, less the states that were diffuse
  Eigen::Index informed = 0;    ///< values that have added to the information
  Eigen::VectorXd half_traces;  ///< of them, 1/2 tr(Sigma^-1 dSigma), by parameter
};

struct CommonFactor {
  Eigen::VectorXd weights;   ///< w above, k
  std::size_t left_out = 0;  ///< the parameter that has most to do with the innovations' size
};

/// Nothing where not all noise is free, or there is none.
std::optional<CommonFactor> common_factor(const StateSpace& model,
                                          const std::vector<StateSpace>& derivatives);

/// Adds to `out`, of k parameters, what the others have been found to say, k - 1 of them.
void add_completed(const Likelihood& of_others, const FactorSums& sums, const CommonFactor& factor,
                   Likelihood& out);

}  // namespace identikal
