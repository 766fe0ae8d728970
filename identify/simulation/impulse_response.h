// How do the outputs answer to one impulse, of an input or of the noise that drives a state?
#pragma once

#include <iosfwd>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "identify/estimate/results.h"
#include "identify/model/model.h"

namespace identikal {

/// How well parameters of a model are known.
struct ParameterErrors {
  std::vector<Eigen::Index> entries;  ///< of free_entries(): those with an error
  Eigen::MatrixXd covariance;         ///< of them, SI
};

/// From the standard errors and correlations of a result. Parameters whose error is not known, as of those
/// at a boundary, count as known.
/// @param model  of that result; where its free entries are others, there are no errors
ParameterErrors parameter_errors(const StoredEstimate& result, const Model& model);

/// Rows k = 0, 1, ...: of an input, D at 0 and C A^(k-1) B behind; of process noise, 0 and
/// C A^(k-1) G. In the outputs' units, for one unit of what the impulse is of.
struct ImpulseResponse {
  std::vector<std::string> names, units;  ///< of the outputs
  Eigen::VectorXd time;                   ///< rows [s]
  Eigen::MatrixXd mean;                   ///< ny x rows
  Eigen::MatrixXd sd;  ///< likewise, by the slopes at the estimates; empty: not known
};

/// Example:
///
///     const ImpulseResponse h = impulse_response(model, "u", 40, {});
///     std::printf("%g\n", h.mean(0, 1));
///
/// @param model    linear, the same at every sample, with a sampling period and inputs held constant
/// @param impulse  name of an input; of a state (of matrices: x1, x2, ...), for the noise in its equation
/// @throws InputError for another model, and a name that is neither
ImpulseResponse impulse_response(const Model& model, const std::string& impulse, Eigen::Index rows,
                                 const ParameterErrors& errors);

/// Time [s], and of every output its response and, where there are errors, its standard error and the
/// ends of a 95 % interval.
void write_impulse_csv(std::ostream& out, const ImpulseResponse& response);

}  // namespace identikal
